"""Compiling: functions on flat buffers, run as plain Python or as machine code; the same source for both.

``@compiled`` marks a function that numba may translate. Its machine code is stored in a file, with a digest of all
that it depends on.

Order: buffer_function, machine_code, translation, compilation, compiled_cache, compiled.
"""

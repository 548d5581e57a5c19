"""Compiling: functions on flat buffers, run as plain Python or as machine code; the same source for both.

A function says by ``@compiled`` that numba may translate it. Its machine code is kept in a file, under a digest of
everything that it is made of.

Order: buffer_function, machine_code, translation, compilation, compiled_cache, compiled.
"""

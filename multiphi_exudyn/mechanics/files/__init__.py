"""Files: structures read from matrix files of other codes.

Order: text_matrices, array_files, matrix_files.
"""

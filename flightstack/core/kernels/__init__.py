"""Compilation of kernels with Numba, and their cache; other packages mark functions with ``core.compiled``."""

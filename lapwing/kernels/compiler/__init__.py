"""Compile pipeline on top of numba: decorators, cache, calling convention."""

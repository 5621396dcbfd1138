"""Export of compiled blocks as native libraries and FMUs, and the import of FMUs.

An exported part is the machine code of its blocks, an image of their memory before the first tick, and a C runtime that
steps them in the order of the block diagram. It contains neither Python nor numba.
"""

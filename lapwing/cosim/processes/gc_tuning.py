"""How a process of this project looks for garbage."""

import atexit
import gc

OBJECTS = 50_000  # new ones between two looks; with Python's 700, they take a sixth of the processor time of a start


def leave_garbage() -> None:
    """Let this process look for garbage seldom, and not at its end: numba leaves so much that the last look takes a
    third of a start."""
    gc.set_threshold(OBJECTS)
    atexit.unregister(gc.freeze)
    atexit.register(gc.freeze)

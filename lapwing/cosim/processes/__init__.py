"""Processes of a run: start, supervision, shutdown."""

import atexit
import gc

OBJECTS = 50_000  # new objects between two collections; with Python's 700, collections take 1/6 of the start-up time


def relax_gc() -> None:
    """Collect garbage rarely, and not at exit.

    Numba leaves so many objects that the last collection takes a third of the start-up time."""
    gc.set_threshold(OBJECTS)
    atexit.unregister(gc.freeze)
    atexit.register(gc.freeze)

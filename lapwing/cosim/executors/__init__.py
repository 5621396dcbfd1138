"""Executors of a block diagram: single process, and lock step over the bus."""

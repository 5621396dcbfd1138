"""Live page of a run in progress."""

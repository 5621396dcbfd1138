"""FMUs as services of the lock step, each in a separate process."""

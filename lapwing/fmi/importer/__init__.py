"""FMUs as services of a run."""

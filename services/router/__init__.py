"""The listen endpoint for programs outside a run."""

"""The door for programs outside a run."""

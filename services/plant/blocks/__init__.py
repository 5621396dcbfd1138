"""The plants, compiled: one file each, with the class of its parameters and its `step`."""

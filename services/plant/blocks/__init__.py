"""Compiled plant blocks: one file each, with the class of its parameters and its `step`."""

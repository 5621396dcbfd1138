"""Campaign: one scene with many seeds, and how its figures are distributed."""

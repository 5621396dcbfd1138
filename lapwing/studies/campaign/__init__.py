"""Campaign: many runs of one scene, and the distributions of their metrics."""

"""Results of the studies on the console, as JSON, and as pages."""

"""Scene tables that several services read."""

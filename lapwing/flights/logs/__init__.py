"""Contents of a log, differences of two logs, and export to tables."""

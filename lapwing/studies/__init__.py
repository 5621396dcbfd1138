"""Studies: accuracy, effects, stability, campaigns, tuning, reports."""

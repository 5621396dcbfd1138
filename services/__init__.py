"""Services of a run, one package each, and the process table."""

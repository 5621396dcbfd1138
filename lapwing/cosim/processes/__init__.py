"""Processes of a run: start, supervision, shutdown."""

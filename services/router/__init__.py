"""Listening endpoint for programs outside of a run."""

"""Recorder: writes the messages of all services to an MCAP log."""

"""Writes what the services say to an MCAP log."""

"""Playback of a log on the bus, as in the live run."""

"""Serves the Foxglove WebSocket protocol: topics as they are, with the simulation's time."""

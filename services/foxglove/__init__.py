"""Foxglove WebSocket server: topics with simulation time."""

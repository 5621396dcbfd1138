"""Adapter of ArduPilot's software-in-the-loop program over its JSON interface (UDP)."""

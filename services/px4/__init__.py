"""Adapter of PX4's software-in-the-loop program over its simulator interface (MAVLink over TCP)."""

"""Equations of motion of the vehicles, and airframe files."""

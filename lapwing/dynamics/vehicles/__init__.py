"""Equations of motion of each vehicle, and airframe files."""

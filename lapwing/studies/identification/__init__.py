"""Identification: parameters of the plant estimated from recorded flights."""

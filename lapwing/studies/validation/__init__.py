"""Validation: prediction errors of the plant against recorded flights."""

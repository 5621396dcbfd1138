"""Quadrotors that carry a load by rigid links."""

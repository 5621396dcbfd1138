"""The control of quadrotors that carry a load together."""

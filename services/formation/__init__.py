"""The formation service: control of quadrotors that carry a common load."""

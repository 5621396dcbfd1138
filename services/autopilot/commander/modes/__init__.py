"""Flight modes, one module each with `NAME` and a class `Mode`."""

"""`lapwing tune`: the plant linearised about hover, and a gain set designed for it."""

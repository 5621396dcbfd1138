"""`lapwing tune`: design of a gain set for the plant linearised about hover."""

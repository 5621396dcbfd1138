"""The trajectory: what the vehicle is asked to do, as a function of time (theory.md, section 4.1)."""

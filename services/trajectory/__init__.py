"""The trajectory service: setpoints as a function of time (theory.md, section 4.1)."""

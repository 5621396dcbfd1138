"""The trajectory service: setpoints as a function of time (theory, section 4.1)."""

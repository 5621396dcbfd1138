"""The autopilot: estimator and controller (theory.md, section 4)."""

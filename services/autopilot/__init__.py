"""The autopilot service: estimator, controller and commander (theory.md, section 4)."""

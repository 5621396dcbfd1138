"""The autopilot service: estimator, controller and commander (theory, section 4)."""

"""The user's own code in the autopilot: a controller in the place of the cascaded PID, an estimator in that of the
filter. `services.common.controllers` and `services.common.estimators` say what they are given and return."""

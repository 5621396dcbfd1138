"""The user's own code in the autopilot: a controller in the place of the cascaded PID, an estimator in that of the
filter. `lapwing.services.common.controller_api` and `lapwing.services.common.estimator_api` say what they are
given and return."""

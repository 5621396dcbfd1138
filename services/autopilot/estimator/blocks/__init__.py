"""Where the vehicle is, as the autopilot sees it: the estimator on the sensors, or the truth (the paper's case).

One part for each sensor, in the order in which their readings are taken in; they share the filter's state.
"""

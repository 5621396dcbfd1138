"""Injected failures: a part between each sensor and the estimator, behind the battery, and before the motors.

They are compiled in where an operator is listened to, who may inject once `SYS_FAILURE_EN` is 1. The topics of the
sensors show what the sensors read; what the autopilot gets of it is what fails.
"""

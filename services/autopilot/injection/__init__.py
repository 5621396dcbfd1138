"""Injected failures: a part between each sensor and the estimator, behind the battery, and before the motors.

They are compiled in only where `SYS_FAILURE_EN` is set at the start. The topics of the sensors show what the sensors
read; what the autopilot gets of it is what fails.
"""

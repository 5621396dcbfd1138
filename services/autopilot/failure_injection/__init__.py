"""Failure injection blocks between sensors and estimator, after the battery, and before the motors.

They exist if the scene accepts operator commands, and act once `SYS_FAILURE_EN` is 1. Sensor topics show the readings
without injected failures.
"""

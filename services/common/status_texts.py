"""In what words the autopilot says what it did and why: ground stations are told the same by the numbers of events."""

POSITION_LOST = "the position is lost"
MOTOR_FAILED = "a motor has failed"
BATTERY_EMPTY = "the battery is nearly empty"
BATTERY_CRITICAL = "the battery is critical"
BATTERY_LOW = "the battery is low"
LINK_LOST = "the ground station is lost"
SETPOINTS_LOST = "the offboard setpoints are lost"
FENCE_LEFT = "the vehicle has left the fence"
FAILSAFES = (
    POSITION_LOST, MOTOR_FAILED, BATTERY_EMPTY, BATTERY_CRITICAL, BATTERY_LOW, LINK_LOST, SETPOINTS_LOST, FENCE_LEFT,
)  # fmt: skip
"""Why a failsafe takes over; an event's number for one is its place here."""

NOT_STARTED = "the estimator has not started"
NO_READINGS = "no good readings of the {}"  # and the source's name
POSITION_UNCERTAIN = "the position is uncertain"
ATTITUDE_UNCERTAIN = "the attitude is uncertain"
NOT_LEVEL = "the vehicle does not stand level"
OUTSIDE_FENCE = "the vehicle stands outside of the fence"
"""Why the vehicle cannot be armed; besides BATTERY_LOW, with the charge behind it."""

ARMED, DISARMED, LANDED = "armed", "disarmed: {}", "landed"
AS_COMMANDED, AFTER_LANDING, NO_TAKEOFF = "as commanded", "landed", "nobody took off"
"""Why it was disarmed."""
TAKEN_OVER = "{}: {}"  # why, and in which mode

ROUTINE = frozenset((ARMED, LANDED, *[DISARMED.format(reason) for reason in (AS_COMMANDED, AFTER_LANDING, NO_TAKEOFF)]))
"""Texts of what happens in every flight."""

"""Status texts of the autopilot, for operators and, by event number, for ground stations."""

POSITION_LOST = "the position is lost"
MOTOR_FAILED = "a motor has failed"
BATTERY_EMPTY = "the battery is nearly empty"
BATTERY_CRITICAL = "the battery is critical"
BATTERY_LOW = "the battery is low"
LINK_LOST = "the ground station is lost"
SETPOINTS_LOST = "the offboard setpoints are lost"
FENCE_LEFT = "the vehicle has left the fence"
KEEP_OUT_ENTERED = "the vehicle has entered a keep-out area"
TOO_FAR, TOO_HIGH = "the vehicle is too far from home", "the vehicle is too high above home"
STICKS_LOST = "the sticks are lost"
FAILSAFES = (
    POSITION_LOST, MOTOR_FAILED, BATTERY_EMPTY, BATTERY_CRITICAL, BATTERY_LOW, LINK_LOST, SETPOINTS_LOST, FENCE_LEFT,
    STICKS_LOST, KEEP_OUT_ENTERED, TOO_FAR, TOO_HIGH,
)  # fmt: skip
"""Failsafe reasons; the index is the reason's event number."""

NOT_STARTED = "the estimator has not started"
NO_READINGS = "no good readings of the {}"  # sensor
POSITION_UNCERTAIN = "the position is uncertain"
ATTITUDE_UNCERTAIN = "the attitude is uncertain"
NOT_LEVEL = "the vehicle is not level"
OUTSIDE_FENCE, IN_KEEP_OUT = "the vehicle is outside the fence", "the vehicle is in a keep-out area"
"""Arming blockers; BATTERY_LOW followed by the charge is another."""

ARMED, DISARMED, LANDED = "armed", "disarmed: {}", "landed"
HELD = "an obstacle holds the vehicle"
TURNED_OVER = "the vehicle has turned over"
STOPPED = "the operator has stopped the motors in flight"
AS_COMMANDED, AFTER_LANDING, NO_TAKEOFF = "as commanded", "landed", "no takeoff after arming"
"""Reasons for disarming; that of a failsafe is another."""
TAKEN_OVER = "{}: {}"  # reason and mode of a failsafe

IMU_FAILED = "IMU {} has failed, IMU {} is in use"  # for redundant units

ROUTINE = frozenset((ARMED, LANDED, *[DISARMED.format(reason) for reason in (AS_COMMANDED, AFTER_LANDING, NO_TAKEOFF)]))
"""Texts of events that every flight has."""
HOLDING = "hold until told otherwise at"  # phase of a mission

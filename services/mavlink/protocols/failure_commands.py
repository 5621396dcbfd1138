"""Command that injects failures."""

from lapwing.services.common.failure_types import UNITS, rejection_text, supported_types
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.protocols.commands import UNSUPPORTED, Command, Outcome, Request, rule
from lapwing.services.mavlink.session import Session

_UNITS = {  # by FAILURE_UNIT
    mavlink.FAILURE_UNIT_SENSOR_GYRO: "gyro",
    mavlink.FAILURE_UNIT_SENSOR_ACCEL: "accelerometer",
    mavlink.FAILURE_UNIT_SENSOR_MAG: "magnetometer",
    mavlink.FAILURE_UNIT_SENSOR_BARO: "barometer",
    mavlink.FAILURE_UNIT_SENSOR_GPS: "gps",
    mavlink.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR: "distance_sensor",
    mavlink.FAILURE_UNIT_SENSOR_OPTICAL_FLOW: "optical_flow",
    mavlink.FAILURE_UNIT_SENSOR_AIRSPEED: "airspeed",
    mavlink.FAILURE_UNIT_SYSTEM_BATTERY: "battery",
    mavlink.FAILURE_UNIT_SYSTEM_MOTOR: "motor",
}


@rule(mavlink.MAV_CMD_INJECT_FAILURE)
def inject_failure(session: Session, c: Command) -> Outcome:
    """Inject a failure of a unit, or repair it."""
    unit, kind = _UNITS.get(int(c.params[0])), int(c.params[1])  # kinds have the numbers of FAILURE_TYPE
    if unit is None:
        session.send_text(f"INJECT_FAILURE: unit {c.params[0]:.0f} unsupported")
        return UNSUPPORTED
    if kind not in supported_types(unit):
        session.send_text(f"INJECT_FAILURE: type {kind} unsupported; {rejection_text(unit)}")
        return UNSUPPORTED
    return Request("inject_failure", (UNITS.index(unit), kind, *c.params[2:]))

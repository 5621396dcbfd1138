"""Motors with their speed controllers (ESC), and battery."""

import math
from typing import Any

from lapwing.messages.topics import ACTUATORS, BATTERY, TRUTH
from lapwing.services.common.mavlink.dialect import mavlink, message_class
from lapwing.services.common.mavlink.frames import saturate
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

PULSE_MIN, PULSE_SPAN = 1000.0, 1000.0  # [us] of a servo signal at no and at full voltage
PULSE_STOPPED = 900.0  # [us] of a motor that is switched off, as in PX4's simulation
OUTPUTS, ACTUATORS_MAX = 8, 32  # outputs in SERVO_OUTPUT_RAW and ACTUATOR_OUTPUT_STATUS
CELLS, MORE_CELLS = 10, 4  # cells in the two lists of BATTERY_STATUS
EMPTY = 0xFFFF  # absent cell of the first list; in the second list it is 0
_STATES = (
    mavlink.MAV_BATTERY_CHARGE_STATE_OK,
    mavlink.MAV_BATTERY_CHARGE_STATE_LOW,
    mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL,
    mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY,
)


def motor_fractions(v: VehicleCache) -> list[float]:
    """Return the voltage of each motor over its maximum, 0 to 1."""
    actuators = v.get(ACTUATORS)
    if actuators is None or v.description.max_voltage is None:
        return []
    return [min(1.0, max(0.0, u / v.description.max_voltage)) for u in actuators.motor_voltage]


@stream("SERVO_OUTPUT_RAW", 5.0, 10.0)
def servo_output(v: VehicleCache) -> Any:
    """Return the motor commands as pulse widths."""
    pulses = [round(PULSE_MIN + PULSE_SPAN * fraction) for fraction in motor_fractions(v)[:OUTPUTS]]
    if not pulses:
        return None
    return mavlink.MAVLink_servo_output_raw_message(v.boot_us & 0xFFFFFFFF, 0, *pulses, *[0] * (OUTPUTS - len(pulses)))


@stream("ACTUATOR_OUTPUT_STATUS", 0.0, 10.0)
def actuator_outputs(v: VehicleCache) -> Any:
    """Return the motor commands as pulse widths, up to 32."""

    def pulse(motor: int, fraction: float) -> float:
        is_off = fraction == 0.0 and (not v.status.armed or motor == v.status.failed_motor)
        return PULSE_STOPPED if is_off else PULSE_MIN + PULSE_SPAN * fraction

    pulses = [pulse(k, fraction) for k, fraction in enumerate(motor_fractions(v)[:ACTUATORS_MAX], 1)]
    if not pulses:
        return None
    active = (1 << len(pulses)) - 1
    padded = pulses + [0.0] * (ACTUATORS_MAX - len(pulses))
    return mavlink.MAVLink_actuator_output_status_message(v.boot_us, active, padded)


def remaining_charge(battery: Any) -> int:
    """Return the remaining charge [%]; -1: unknown."""
    return saturate(100.0 * battery.percentage, 8, unknown=-1)


@stream("BATTERY_STATUS", 0.5, 0.5)
def battery_status(v: VehicleCache) -> Any:
    """Return the state of the battery, cell by cell."""
    b = v.get(BATTERY)
    if b is None:
        return None
    cells = [saturate(1e3 * u, 16, unsigned=True) for u in b.cell_voltage] or [saturate(1e3 * b.voltage, 16, True)]
    first, more = cells[:CELLS], cells[CELLS:][:MORE_CELLS]
    is_known = math.isfinite(b.percentage)
    used = 1e3 * (b.design_capacity - b.charge)  # [mA h]
    return mavlink.MAVLink_battery_status_message(
        0,
        mavlink.MAV_BATTERY_FUNCTION_ALL,
        mavlink.MAV_BATTERY_TYPE_LIPO,
        saturate(1e2 * b.temperature, 16),
        first + [EMPTY] * (CELLS - len(first)),
        saturate(-1e2 * b.current, 16, unknown=-1),
        saturate(used, 32, unknown=-1),
        -1,
        remaining_charge(b),
        charge_state=_STATES[v.status.battery_warning] if is_known else mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED,
        voltages_ext=more + [0] * (MORE_CELLS - len(more)),
    )


def power(v: VehicleCache) -> tuple[int, int, int]:
    """Return voltage [mV], current [0.01 A] and remaining charge [%] for SYS_STATUS."""
    b = v.get(BATTERY)
    if b is None or not math.isfinite(b.voltage):
        return 0xFFFF, -1, -1
    return saturate(1e3 * b.voltage, 16, unsigned=True), saturate(-1e2 * b.current, 16, unknown=-1), remaining_charge(b)


BATCH = 4  # motors of one message
RPM = 60.0 / math.tau  # [1/min] per rad/s
SERIAL = 1  # ESC_CONNECTION_TYPE_SERIAL
UNKNOWN_TEMPERATURE = 0x7FFF


def _pad(values: Any, filler: Any) -> list[Any]:
    return [*list(values)[:BATCH], *[filler] * (BATCH - min(BATCH, len(values)))]


@stream("ESC_STATUS", 1.0, 10.0)
def esc_status(v: VehicleCache) -> Any:
    """Return rotor speed, voltage and current of each motor."""
    truth = v.get(TRUTH)
    if truth is None or not truth.rotor_speed:
        return None
    rpm = [saturate(RPM * speed, 32, unknown=0) for speed in truth.rotor_speed]
    return message_class("ESC_STATUS")(
        0, v.boot_us, _pad(rpm, 0), _pad(truth.motor_voltage, 0.0), _pad(truth.motor_current, 0.0)
    )


@stream("ESC_INFO", 1.0, 1.0)
def esc_info(v: VehicleCache) -> Any:
    """Return the available speed controllers, all without faults."""
    truth = v.get(TRUTH)
    if truth is None or not truth.rotor_speed:
        return None
    count = len(truth.rotor_speed)
    online = (1 << min(8, count)) - 1
    counter = v.time_ns // 1_000_000_000 & 0xFFFF
    return message_class("ESC_INFO")(
        0, v.boot_us, counter, count, SERIAL, online, [0] * BATCH, [0] * BATCH, [UNKNOWN_TEMPERATURE] * BATCH
    )

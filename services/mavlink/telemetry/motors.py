"""Reports of the speed controllers (ESC) of the first four motors."""

import math
from typing import Any

from lapwing.messages.topics import TRUTH
from lapwing.services.common.mavlink.dialect import message_class
from lapwing.services.common.mavlink.frames import saturate
from lapwing.services.mavlink.telemetry.message_stream import stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

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

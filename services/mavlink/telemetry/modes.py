"""Available and current flight modes (MAVLink guide, "Standard Modes Protocol")."""

import math
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.telemetry.message_stream import on_request, stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache


@stream("CURRENT_MODE", 0.5)
def current_mode(v: VehicleCache) -> Any:
    """Return the flight mode; the intended mode is the same."""
    number = v.firmware.mode_number(v.status.mode)
    standard = {mode.number: mode.standard for mode in v.firmware.MODES}
    return mavlink.MAVLink_current_mode_message(
        standard.get(number, mavlink.MAV_STANDARD_MODE_NON_STANDARD), number, number
    )


@on_request("AVAILABLE_MODES")
def available_modes(v: VehicleCache, index: float) -> list[Any]:
    """Return the mode of an index from 1, or all modes for 0."""
    modes = v.firmware.MODES
    desired = 0 if math.isnan(index) else round(index)
    messages = []
    for number, mode in enumerate(modes, start=1):
        if desired in (0, number):
            has_name = mode.standard == mavlink.MAV_STANDARD_MODE_NON_STANDARD  # others have a standard name
            properties = mavlink.MAV_MODE_PROPERTY_ADVANCED if mode.advanced else 0
            name = mode.name.encode() if has_name else b""
            messages.append(
                mavlink.MAVLink_available_modes_message(
                    len(modes), number, mode.standard, mode.number, properties, name
                )
            )
    return messages

"""Identity and capabilities of the vehicle, its flight modes and the number of its events."""

import math
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink, message_class
from lapwing.services.mavlink import component_metadata
from lapwing.services.mavlink.file_server import crc32
from lapwing.services.mavlink.telemetry.message_stream import on_request, stream
from lapwing.services.mavlink.vehicle_cache import VehicleCache

_CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_ATTITUDE_TARGET
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
    | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_FTP
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
)
VERSION = (1 << 24) | (16 << 16) | (0 << 8) | 255  # emulated PX4: release 1.16.0
MAVLINK_1, MAVLINK_2 = 100, 200  # protocol versions
CHANNELS, NO_CHANNEL, NO_SIGNAL_STRENGTH = 18, 0xFFFF, 255


@stream("AUTOPILOT_VERSION")
def autopilot_version(v: VehicleCache) -> Any:
    """Return the capabilities, including the encoding of integer parameters."""
    zeros = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        _CAPABILITIES | v.firmware.PARAMETER_ENCODING,
        *(VERSION, VERSION, VERSION, 0),
        *(zeros, zeros, zeros),
        *(0, 0, v.description.system_id),
    )


@stream("PROTOCOL_VERSION")
def protocol_version(v: VehicleCache) -> Any:
    """Return version 2, with version 1 as the minimum."""
    zeros = [0] * 8
    return message_class("PROTOCOL_VERSION")(MAVLINK_2, MAVLINK_1, MAVLINK_2, zeros, zeros)


@stream("COMPONENT_METADATA")
def metadata(v: VehicleCache) -> Any:
    """Return the URI of the general metadata file, which names the others."""
    general = component_metadata.files(v.description)[component_metadata.GENERAL]
    uri = component_metadata.uri(component_metadata.GENERAL).encode()
    return message_class("COMPONENT_METADATA")(v.boot_ms, crc32(general), uri)


@stream("RC_CHANNELS")
def rc_channels(v: VehicleCache) -> Any:
    """Return no channels: there is no radio-control receiver."""
    return mavlink.MAVLink_rc_channels_message(v.boot_ms, 0, *[NO_CHANNEL] * CHANNELS, NO_SIGNAL_STRENGTH)


@stream("FLIGHT_INFORMATION")
def flight_information(v: VehicleCache) -> Any:
    """Return the times of arming, take-off and landing since the start, and the number of the flight."""
    f = v.flight
    return mavlink.MAVLink_flight_information_message(
        v.boot_ms, f.armed_ns // 1000, f.takeoff_ns // 1000, f.number, f.landing_ns // 1_000_000
    )


@stream("CURRENT_EVENT_SEQUENCE", 1.0 / 3.0)
def current_sequence(v: VehicleCache) -> Any:
    """Return the number of the last event."""
    return v.events.current() if v.firmware.EVENTS else None


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

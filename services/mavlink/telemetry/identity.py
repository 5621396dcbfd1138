"""Identity and capabilities of the vehicle."""

from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink, message_class
from lapwing.services.mavlink import component_metadata
from lapwing.services.mavlink.file_server import crc32
from lapwing.services.mavlink.telemetry.message_stream import stream
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

"""MAV_TYPE of a vehicle by its number of rotors, for the display of ground stations."""

from lapwing.services.common.mavlink.dialect import mavlink

_TYPES = {
    3: mavlink.MAV_TYPE_TRICOPTER,
    4: mavlink.MAV_TYPE_QUADROTOR,
    6: mavlink.MAV_TYPE_HEXAROTOR,
    8: mavlink.MAV_TYPE_OCTOROTOR,
    10: mavlink.MAV_TYPE_DECAROTOR,
    12: mavlink.MAV_TYPE_DODECAROTOR,
}


def vehicle_type(rotors: int) -> int:
    """Return the MAV_TYPE of a multirotor.

    Coaxial rotors count individually, as in PX4 and ArduPilot: MAV_TYPE_COAXIAL is a helicopter.
    """
    return _TYPES.get(rotors, mavlink.MAV_TYPE_GENERIC_MULTIROTOR)

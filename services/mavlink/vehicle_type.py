"""What ground stations are told that a vehicle is, by its rotors: they draw and name it by that."""

from lapwing.services.mavlink.dialect import mavlink

_TYPES = {
    3: mavlink.MAV_TYPE_TRICOPTER,
    4: mavlink.MAV_TYPE_QUADROTOR,
    6: mavlink.MAV_TYPE_HEXAROTOR,
    8: mavlink.MAV_TYPE_OCTOROTOR,
    10: mavlink.MAV_TYPE_DECAROTOR,
    12: mavlink.MAV_TYPE_DODECAROTOR,
}


def vehicle_type(rotors: int) -> int:
    """The MAV_TYPE of a multirotor.

    Rotors over one another count one by one, as in PX4 and ArduPilot: MAV_TYPE_COAXIAL is a helicopter's.
    """
    return _TYPES.get(rotors, mavlink.MAV_TYPE_GENERIC_MULTIROTOR)

"""Actuator metadata for ground stations: output, position and spin direction of each motor.

The format is MAVLink's component_metadata/actuators.schema.json, with the entries of PX4: QGroundControl builds its
actuator page from it. All entries are read-only, and motors cannot be run one by one.
"""

from collections.abc import Sequence
from typing import Any

from lapwing.services.common.mavlink.frames import swap_body
from lapwing.services.mavlink.px4_facts import FIRST_MOTOR, MULTIROTOR, output_function
from lapwing.services.mavlink.vehicle_description import Rotor

VERSION = 2  # version of the format
_STOPPED, _FULL = 0.0, 1.0


def actuators(rotors: Sequence[Rotor]) -> dict[str, Any]:
    """Return the description of the motors as a JSON tree."""
    numbers = range(1, len(rotors) + 1)
    channel = {"name": output_function("${i}"), "label": "Function", "function": "function"}
    channels = [{"label": f"Channel {n}", "param-index": n} for n in numbers]
    functions: dict[str, Any] = {"0": {"label": "Disabled"}}
    for n in numbers:
        functions[str(FIRST_MOTOR + n - 1)] = {"label": f"Motor {n}", "exclude-from-actuator-testing": True}
    return {
        "version": VERSION,
        "outputs_v1": [
            {"label": "Simulation", "subgroups": [{"per-channel-parameters": [channel], "channels": channels}]}
        ],
        "functions_v1": functions,
        "mixer_v1": {
            "actuator-types": {
                "DEFAULT": {"values": {"min": _STOPPED, "max": _FULL}},
                "motor": {
                    "function-min": FIRST_MOTOR,
                    "function-max": FIRST_MOTOR + len(rotors) - 1,
                    "label-index-offset": 1,
                    "values": {"min": _STOPPED, "max": _FULL, "default": _STOPPED},
                },
            },
            "config": [_geometry(rotors)],
        },
    }


def _geometry(rotors: Sequence[Rotor]) -> dict[str, Any]:
    """Return the rotor geometry in FRD axes, as in PX4."""
    x, y, z = zip(*(swap_body(rotor.position_body) for rotor in rotors), strict=True)
    directions = [float(rotor.counterclockwise) for rotor in rotors]
    values = {
        "posx": ("Position X", x),
        "posy": ("Position Y", y),
        "posz": ("Position Z", z),
        "spin-dir": ("Direction CCW", directions),
    }
    return {
        "option": f"CA_AIRFRAME=={MULTIROTOR}",
        "type": "multirotor",
        "title": "Multirotor",
        "actuators": [
            {
                "group-label": "Motors",
                "actuator-type": "motor",
                "required": True,
                "count": len(rotors),
                "per-item-parameters": [
                    {"label": label, "function": function, "value": list(value)}
                    for function, (label, value) in values.items()
                ],
            }
        ],
    }

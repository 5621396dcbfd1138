"""Sentences about effects, sensors and presets for schemas, the reference pages and `lapwing effects --list`."""

import re
import sys
from collections.abc import Iterator
from types import ModuleType

from lapwing.dynamics import effects
from lapwing.dynamics.config_error import ConfigError
from lapwing.file_schemas.key_docs import Key, description, first_sentence, keys

CITATION = re.compile(r" \(theory(?:[^()]|\([^)]*\))*\)")
EFFECTS = {"ground_contact": "Contact of feet and hull with the ground: stiffness, damping, and friction that sticks"}
PRESETS = {  # by sensor; the comments above the presets have the data sheets, and what was chosen
    "airspeed": {"sdp33": "Sensirion SDP33, to 1500 Pa", "ms4525do": "TE MS4525DO, to 1 psi"},
    "barometer": {"ms5611": "TE MS5611, of most autopilots", "dps422": "Infineon DPS422, less noise"},
    "depth_camera": {
        "realsense_d435": "Intel RealSense D435, 0.3 to 10 m",
        "realsense_d455": "Intel RealSense D455, 0.6 to 20 m",
    },
    "external_vision": {
        "motion_capture": "cameras in the room, about 1 mm",
        "odometry": "a camera on board, about 2 cm, 40 ms late",
    },
    "gps": {
        "rtk": "u-blox ZED-F9P with corrections, about 2 cm",
        "standard": "u-blox NEO-M8 without corrections, about 2.5 m",
    },
    "imu": {
        "mpu6000": "InvenSense MPU-6000, of many older autopilots",
        "bmi088": "Bosch BMI088, for vehicles with strong vibration",
    },
    "lidar": {"vlp16": "Velodyne VLP-16, 16 rings to 100 m", "rplidar_a2": "Slamtec RPLIDAR A2, one ring to 12 m"},
    "magnetometer": {"rm3100": "PNI RM3100, 15 nT of noise", "hmc5883l": "Honeywell HMC5883L, 200 nT of noise"},
    "optical_flow": {
        "pmw3901": "PixArt PMW3901, for bright light",
        "paw3902": "PixArt PAW3902 with gyroscopes, also for dim light",
    },
    "rangefinder": {"lidar_lite_v3": "Garmin LIDAR-Lite v3, to 40 m", "tfmini": "Benewake TFmini, 0.3 to 12 m"},
    "sonar": {"mb1202": "MaxBotix MB1202, 0.2 to 7.65 m", "hc_sr04": "HC-SR04, 0.02 to 4 m"},
}


def effect(name: str) -> str:
    """Return the sentence about an effect."""
    return EFFECTS.get(name) or first_sentence(effects.get(name))


def sensor(module: ModuleType) -> str:
    """Return the sentence about a sensor."""
    return CITATION.sub("", first_sentence(module))


def presets(name: str, module: ModuleType) -> dict[str, str]:
    """Return the sentence about each preset of a sensor."""
    known = {**PRESETS.get(name, {}), "ideal": "without errors"}
    return {preset: known.get(preset, "") for preset in module.PRESETS}


def effect_settings(name: str) -> type:
    """Return the class with the keys of an effect's table; some effects resolve it to another class."""
    cls = effects.parameter_class(name)
    return sys.modules[cls.__module__].Settings if hasattr(cls, "from_scene") else cls


def effects_list(names: list[str] | None = None) -> Iterator[str]:
    """Yield a line about each effect, with its cost, and each of its keys; the last line explains costs."""
    from lapwing.studies.effects.operations import FLIGHT, operations  # needs mpmath

    for name in names or effects.names():
        yield f"{name}: {effect(name)}; {_cost(name)}"
        for key in keys(effect_settings(name)):
            yield f"    {key.name}{_value(key)}: {description(key)}"
    yield (
        f"Operations: in a step of RK4 of 1 ms, hovering at 10 m; {operations(FLIGHT)} with {' and '.join(FLIGHT)}. "
        "`lapwing effects SCENE` measures nanoseconds."
    )


def _cost(name: str) -> str:
    """Return the cost of an effect for the delivery drone."""
    from lapwing.studies.effects.operations import added_operations

    try:
        return f"adds {added_operations(name)} operations"
    except ConfigError as error:
        return f"not counted, because {error.message.partition(';')[0]}"


def _value(key: Key) -> str:
    plain = isinstance(key.default, bool | int | float | str) or (isinstance(key.default, tuple) and key.default)
    return f" = {key.default}" if plain else ""

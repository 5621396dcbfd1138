"""Interface for extensions: all names that a user's module imports, besides `lapwing` itself.

- controllers: `VehicleModel`, `StateEstimate`, `Setpoint`, `ThrustAndMoments`, `MotorVoltages`
- estimators: `VehicleModel`, `StateEstimate` and the readings of the sensors
- effects: the hooks (`wrench`, `air`, `loads`, ...), `EffectInputs`, `Motion`, `Air`, ...
- sensors: `Truth` with the `OtherVehicle`s of a fleet, random numbers (`normal`, `uniform`), `reduce_tuple`
- trajectory segments: `Segment`, `Piece`, and the types of keys `Finite` and `Positive`
- MAVLink messages: `stream` declares one, `mavlink` has the message classes
- compiled code: `kernel`, `python_function`, vectors and rotations

A name is imported when it is first used, so an effect does not import the controller interface.
"""

import importlib
from typing import Any

_MODULES = {
    "lapwing.dynamics.effects._types": (
        "Air",
        "EffectInputs",
        "Factors",
        "Loads",
        "MassProperties",
        "Motion",
        "Rotors",
    ),
    "lapwing.dynamics.lie.quaternion": ("rotation_matrix",),
    "lapwing.dynamics.lie.so3": ("vee",),
    "lapwing.dynamics.noise": ("normal", "normal3", "uniform"),
    "lapwing.dynamics.vector": (
        *("ZERO", "Mat3", "Vec3", "add", "apply", "apply_transposed", "cross", "divide", "dot", "matmul", "multiply"),
        *("norm", "scale", "subtract", "transpose"),
    ),
    "lapwing.kernels": ("kernel", "python_function"),
    "lapwing.kernels.codegen": ("reduce_tuple",),
    "lapwing.services.common.controller_api": ("MotorVoltages", "ThrustAndMoments", "VehicleModel"),
    "lapwing.services.common.ports": (
        *("AirspeedReading", "BarometerReading", "BatteryReading", "DistanceReading", "GpsReading", "ImuReading"),
        *("MagnetometerReading", "OpticalFlowReading", "Setpoint", "StateEstimate", "TrueState"),
    ),
    "lapwing.services.common.mavlink.dialect": ("mavlink",),
    "lapwing.services.mavlink.telemetry.message_stream": ("stream",),
    "lapwing.services.sensors.sensor_inputs": ("OtherVehicle", "Truth"),
    "lapwing.services.trajectory.polynomial_piece": ("Piece",),
    "lapwing.services.trajectory.segments.segment": ("Finite", "Positive", "Segment"),
}
_HOOKS = "lapwing.dynamics.effects._hooks"
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a name of the interface. Raise AttributeError for any other."""
    if name in _MODULE_OF:
        return getattr(importlib.import_module(_MODULE_OF[name]), name)
    if not name.startswith("_"):
        hooks = importlib.import_module(_HOOKS)
        if name in hooks.HOOKS and hasattr(hooks, name):
            return getattr(hooks, name)
    raise AttributeError(f"module 'lapwing.plugins' has no attribute {name!r}")


def __dir__() -> list[str]:
    hooks = importlib.import_module(_HOOKS)
    return sorted({*_MODULE_OF, *(name for name in hooks.HOOKS if hasattr(hooks, name))})

"""Loading and checking of user-defined controllers and estimators."""

import copy
import inspect
import math
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

import numba
from numba.core.errors import NumbaError

from lapwing.cosim.config.user_module import FAULTS, blame
from lapwing.dynamics.config_error import ConfigError
from lapwing.kernels.cell import Cell
from lapwing.services.autopilot.controller_parameters import Airframe
from lapwing.services.autopilot.custom.controller_output import parse_controller_output
from lapwing.services.autopilot.custom.estimator_api import validate_estimate
from lapwing.services.autopilot.motor import thrust_at
from lapwing.services.common.controller_api import MotorVoltages, ThrustAndMoments, VehicleModel
from lapwing.services.common.ports import Setpoint, StateEstimate
from lapwing.services.common.user_code import load_object

CONTROLLER, ESTIMATOR = "autopilot.controller", "autopilot.estimator"
OUTPUTS = (MotorVoltages, ThrustAndMoments)


def vehicle_model(a: Airframe, interval: float) -> VehicleModel:
    """Return the vehicle parameters for user code."""
    return VehicleModel(
        a.mass,
        a.inertia_body,
        a.gravity,
        tuple(zip(a.rotor_x, a.rotor_y, a.rotor_z or (0.0,) * len(a.rotor_x), strict=True)),
        a.reaction_sign,
        a.torque_per_thrust,
        thrust_at(a.motor, a.voltage_max),
        a.voltage_max,
        a.motor.time_constant,
        a.resting_height,
        interval,
        a.rotor_axis or ((0.0, 0.0, 1.0),) * len(a.rotor_x),
    )


def controller_rate(name: str, texts: Mapping[str, str], vehicle: VehicleModel, options: Mapping[str, Any]) -> float:
    """Return the rate [Hz] of a controller after a trial step on the ground.

    Args:
        name: "module:Name".
        texts: module texts of the run configuration.
        vehicle: vehicle parameters.
        options: options of the constructor.

    Raises:
        ConfigError: the controller cannot be constructed, has no rate, or its step fails or returns another type.
    """
    module, user_code = load_object(CONTROLLER, name, texts)
    start = (0.0, 0.0, vehicle.resting_height)
    arguments = (0.0, StateEstimate(position_world=start), Setpoint(position_world=start))
    if not is_compiled(user_code):
        p = constructor(CONTROLLER, module, user_code, vehicle, options)()
        no_voltage = (0.0,) * len(vehicle.spin_directions)
        _try(CONTROLLER, name, module, p, lambda: parse_controller_output(p.step(*arguments), no_voltage))
        return _rate(CONTROLLER, name, p)
    p, s = compile_controller(module, user_code, vehicle, options)

    def trial() -> None:
        output = module.step(p, s, *arguments)
        if not (type(output) is tuple and len(output) == 2 and isinstance(output[1], OUTPUTS)):
            raise TypeError("step must return (state, MotorVoltages or ThrustAndMoments)")
        if numba.typeof(output[0]) != numba.typeof(s):
            raise TypeError("step returns a state of another type than build; write every number as a float")
        Cell((p, s))  # raises if a cell cannot store them

    _try(CONTROLLER, name, module, module, trial)
    return _rate(CONTROLLER, name, p)


def estimator_rate(name: str, texts: Mapping[str, str], vehicle: VehicleModel, options: Mapping[str, Any]) -> float:
    """Return the rate [Hz] of an estimator after a trial step without readings. See `controller_rate`."""
    module, user_code = load_object(ESTIMATOR, name, texts)
    p = constructor(ESTIMATOR, module, user_code, vehicle, options)()
    _try(ESTIMATOR, name, module, p, lambda: validate_estimate(p.step(0.0, {})))
    return _rate(ESTIMATOR, name, p)


def _try(key: str, name: str, module: ModuleType, owner: Any, step: Callable[[], Any]) -> None:
    if not callable(getattr(owner, "step", None)):
        raise ConfigError(key, f"{name} has no step", "the method `step`")
    try:
        step()
    except FAULTS as error:
        raise ConfigError(key, f"{name}: {_error_text(error, module)}") from error


def _rate(key: str, name: str, p: Any) -> float:
    rate = getattr(p, "rate", None)
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not (math.isfinite(rate) and rate > 0.0):
        raise ConfigError(key, f"{name} has rate = {rate!r}", "a number of steps a second [Hz]")
    return float(rate)


def _error_text(error: BaseException, module: ModuleType) -> str:
    if isinstance(error, NumbaError):
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        return f"cannot be compiled: {lines[1] if len(lines) > 1 else lines[0]}"
    return blame(error, module)


def is_compiled(user_code: Any) -> bool:
    """Return True for a compiled controller, which is a function, not a class."""
    return inspect.isfunction(user_code)


def constructor(
    key: str, module: ModuleType, user_code: Any, vehicle: VehicleModel, options: Mapping[str, Any]
) -> Callable[[], Any]:
    """Return a function that constructs the user's class, or copies the user's object, that `key` names.

    Raises:
        ConfigError: an object has options, or the constructor fails.
    """
    if options and not inspect.isclass(user_code):
        raise ConfigError(f"{key}_options", f"a {type(user_code).__name__} object takes no options", "a class")

    cls: Callable[..., Any] | None = user_code if inspect.isclass(user_code) else None

    def construct() -> Any:
        try:
            return cls(vehicle, **options) if cls else copy.deepcopy(user_code)
        except FAULTS as error:
            raise _constructor_error(key, error, module, options) from error

    return construct


def compile_controller(
    module: ModuleType, user_code: Any, vehicle: VehicleModel, options: Mapping[str, Any]
) -> tuple[Any, Any]:
    """Return parameters and initial state of a compiled controller. Raise ConfigError if they are invalid."""
    try:
        p, s = user_code(vehicle, **options)
    except FAULTS as error:
        raise _constructor_error(CONTROLLER, error, module, options) from error
    if type(p).__module__ != module.__name__ or not isinstance(p, tuple) or not hasattr(module, "step"):
        expected = "a NamedTuple of the same module, which also defines `step`"
        raise ConfigError(CONTROLLER, f"{user_code.__name__} returned {type(p).__name__} parameters", expected)
    return p, s


def _constructor_error(key: str, error: BaseException, module: ModuleType, options: Mapping[str, Any]) -> ConfigError:
    """Return the error of a constructor, under the options' key if one of them may be wrong."""
    if not (isinstance(error, TypeError) and "argument" in str(error)):
        return ConfigError(key, blame(error, module))
    expected = "" if options else "a constructor with one argument, the vehicle's model"
    return ConfigError(f"{key}_options" if options else key, blame(error, module), expected)

"""Interface of user-defined controllers; user code imports its names from `lapwing.plugins`.

In a scene:

    [autopilot]
    controller = "my_module:MyController"
    [autopilot.controller_options]
    stiffness = 4.0

In `my_module.py`, next to the scene or on Python's path:

    class MyController:
        rate = 250.0                                              # [Hz], divides the communication rate

        def __init__(self, vehicle: VehicleModel, stiffness: float = 1.0): ...

        def step(self, time: float, estimate: StateEstimate, setpoint: Setpoint) -> ThrustAndMoments: ...

A new controller is constructed at every take-off. Its `step` is called at its rate while the motors run; its last
command holds in between. A controller that uses random numbers, wall time or files cannot be resimulated.

A compiled controller runs in the compiled loop. The scene names a function that returns its parameters and initial
state, NamedTuples of numbers; the parameters have a field `rate`. The module defines `step`, which always returns the
same types:

    def build(vehicle: VehicleModel, **options) -> tuple[Parameters, State]: ...

    @lapwing.plugins.kernel
    def step(p, s, time, estimate, setpoint):
        return s, ThrustAndMoments(thrust, moments_body)
"""

from typing import NamedTuple

from lapwing.dynamics.vector import Vec3
from lapwing.services.common.ports import Setpoint, StateEstimate

__all__ = ["MotorVoltages", "Setpoint", "StateEstimate", "ThrustAndMoments", "VehicleModel"]


class MotorVoltages(NamedTuple):
    """Direct motor command; clipped to 0..`voltage_max`."""

    volts: tuple[float, ...]  # [V] of each motor, in the order of the airframe
    roll_pitch: tuple[float, float] = (0.0, 0.0)  # [rad] references, for the log


class ThrustAndMoments(NamedTuple):
    """Wrench command; control allocation and the motor model turn it into voltages.

    Priority in saturation: roll and pitch, then thrust, then yaw.
    """

    thrust: float  # [N] total, along body z
    moments_body: Vec3  # [N m]
    roll_pitch: tuple[float, float] = (0.0, 0.0)  # [rad] references, for the log


class VehicleModel(NamedTuple):
    """Nominal vehicle parameters for a controller, at standard air density."""

    mass: float  # [kg]
    inertia_body: Vec3  # [kg m^2] principal moments
    gravity: float  # [m/s^2]
    rotor_positions_body: tuple[Vec3, ...]  # [m]
    spin_directions: tuple[float, ...]  # +1 for each rotor whose thrust yaws the vehicle to the left
    torque_per_thrust: float  # [m] reaction torque of a rotor over its thrust
    thrust_max: float  # [N] of a rotor
    voltage_max: float  # [V]
    motor_time_constant: float  # [s] of the rotor speed
    resting_height: float  # [m] world z of the vehicle's origin at rest on the ground
    interval: float  # [s] length of a tick
    rotor_axes_body: tuple[Vec3, ...]  # unit vector of each rotor's thrust

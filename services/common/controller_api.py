"""What a controller of one's own is given, and what it returns.

In a scene:

    [autopilot]
    controller = "my_module:MyController"
    [autopilot.controller_options]
    stiffness = 4.0

In `my_module.py`, beside the scene or on Python's path:

    class MyController:
        rate = 250.0                                              # [Hz], divides the exchange rate

        def __init__(self, vehicle: VehicleModel, stiffness: float = 1.0): ...

        def step(self, time: float, estimate: StateEstimate, setpoint: Reference) -> ThrustAndMoments: ...

It is constructed anew at every take-off, and asked at its rate while the motors run; in between, its command holds.
Randomness, wall time and files make a run one that cannot be flown again.

A compiled controller takes part in the compiled loop at full speed. Its name is that of a function that makes its
parameters and its first state, NamedTuples of numbers; the parameters have a field `rate`. Its module has `step`, and
returns at every step the same types:

    def build(vehicle: VehicleModel, **options) -> tuple[Parameters, State]: ...

    @lapwing.kernels.kernel
    def step(p, s, time, estimate, setpoint):
        return s, ThrustAndMoments(thrust, moments_body)
"""

from typing import NamedTuple

from lapwing.dynamics.vector import Vec3
from lapwing.services.common.ports import Reference, StateEstimate

__all__ = ["MotorVoltages", "Reference", "StateEstimate", "ThrustAndMoments", "VehicleModel"]


class MotorVoltages(NamedTuple):
    """A command to the motors themselves; clipped to 0 to `voltage_max`."""

    volts: tuple[float, ...]  # [V] of each motor, in the order of the airframe
    roll_pitch: tuple[float, float] = (0.0, 0.0)  # [rad] that it steers to, for the log


class ThrustAndMoments(NamedTuple):
    """A command that control allocation turns into thrusts of the rotors, and the motor model into voltages.

    Where the rotors cannot give it, thrust yields to roll and pitch, and yaw to both.
    """

    thrust: float  # [N] of all rotors together, along body z
    moments_body: Vec3  # [N m]
    roll_pitch: tuple[float, float] = (0.0, 0.0)  # [rad] that it steers to, for the log


class VehicleModel(NamedTuple):
    """What a controller knows of the vehicle: nominal values, at standard air density."""

    mass: float  # [kg]
    inertia_body: Vec3  # [kg m^2] principal moments
    gravity: float  # [m/s^2]
    rotor_positions_body: tuple[Vec3, ...]  # [m]
    spin_directions: tuple[float, ...]  # of each rotor: +1 where its thrust turns the vehicle to the left
    torque_per_thrust: float  # [m] reaction torque of a rotor over its thrust
    thrust_max: float  # [N] of a rotor
    voltage_max: float  # [V]
    motor_time_constant: float  # [s] of the rotor speed
    resting_height: float  # [m] world z of the vehicle's origin when it stands
    interval: float  # [s] a tick
    rotor_axes_body: tuple[Vec3, ...]  # unit vector of each rotor's thrust

"""Outputs of systems without commands: gyrostat, OS4 quadrotor, and the crate that unloads its pack."""

from lapwing.dynamics.integrators import rate
from lapwing.dynamics.lie.quaternion import Quaternion
from lapwing.dynamics.vector import ZERO, Vec3
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.kernels import always_inline
from lapwing.papers.gyrostat import GyrostatParameters
from lapwing.papers.quadrotor_os4 import Os4Parameters, Os4State
from lapwing.papers.unloading.unloading import UnloadingParameters, UnloadingState
from lapwing.services.common.ports import TrueState
from lapwing.services.plant.blocks.uncontrolled import OUTPUT_FUNCTIONS


@always_inline
def motion_alone(position: Vec3, attitude: Quaternion, velocity: Vec3, omega_body: Vec3) -> TrueState:
    """Return the true state of a body without rotors."""
    return TrueState(position, attitude, velocity, omega_body, ZERO, (), (), (), (), (), (), ZERO, 0.0, False, ZERO)


@always_inline
def outputs_of_gyrostat(p: GyrostatParameters, t: float, x: RigidBody) -> tuple[TrueState]:
    """Return attitude and angular velocity of the satellite, which rotates about a fixed centre."""
    return (motion_alone(ZERO, x.attitude, ZERO, x.omega_body),)


@always_inline
def outputs_of_unloading(p: UnloadingParameters, t: float, x: UnloadingState) -> tuple[TrueState]:
    """Return the motion of the pack."""
    return (motion_alone(x.position_world, x.attitude, x.velocity_world, x.omega_body),)


@always_inline
def outputs_of_os4(p: Os4Parameters, t: float, x: Os4State) -> tuple[TrueState]:
    """Return the true state with acceleration, rotor thrusts and torques."""
    a, b, c, d = x.rotor_speed
    k, m = p.lift_constant, p.drag_constant
    return (
        TrueState(
            x.position_world, x.attitude, x.velocity_world, x.omega_body, rate(p, t, x).velocity_world,
            x.rotor_speed, (), (), (),
            (k * a * a, k * b * b, k * c * c, k * d * d), (m * a * a, m * b * b, m * c * c, m * d * d),
            ZERO, 0.0, False, ZERO,
        ),
    )  # fmt: skip


OUTPUT_FUNCTIONS[GyrostatParameters] = outputs_of_gyrostat
OUTPUT_FUNCTIONS[UnloadingParameters] = outputs_of_unloading
OUTPUT_FUNCTIONS[Os4Parameters] = outputs_of_os4

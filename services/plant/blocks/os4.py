"""What is told of the OS4 quadrotor: its motion and what its rotors do."""

from lapwing.dynamics.integrators import rate
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.quadrotor_os4 import Os4Parameters, Os4State
from lapwing.kernels import always_inline
from lapwing.services.common.ports import TrueState
from lapwing.services.plant.blocks.uncontrolled import TOLD


@always_inline
def told(p: Os4Parameters, t: float, x: Os4State) -> tuple[TrueState]:
    """The state, its acceleration, thrusts and torques of the rotors."""
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


TOLD[Os4Parameters] = told

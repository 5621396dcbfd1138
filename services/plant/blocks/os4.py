"""Output of the OS4 quadrotor: motion and rotors."""

from lapwing.dynamics.integrators import rate
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.quadrotor_os4 import Os4Parameters, Os4State
from lapwing.kernels import always_inline
from lapwing.services.common.ports import TrueState
from lapwing.services.plant.blocks.uncontrolled import OUTPUT_FUNCTIONS


@always_inline
def outputs_of(p: Os4Parameters, t: float, x: Os4State) -> tuple[TrueState]:
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


OUTPUT_FUNCTIONS[Os4Parameters] = outputs_of

"""Output of a gyrostat satellite, which rotates about a fixed centre."""

from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.gyrostat import GyrostatParameters
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.kernels import always_inline
from lapwing.services.common.ports import TrueState
from lapwing.services.plant.blocks.uncontrolled import OUTPUT_FUNCTIONS


@always_inline
def outputs_of(p: GyrostatParameters, t: float, x: RigidBody) -> tuple[TrueState]:
    """Return attitude and angular velocity."""
    return (TrueState(ZERO, x.attitude, ZERO, x.omega_body, ZERO, (), (), (), (), (), (), ZERO, 0.0, False, ZERO),)


OUTPUT_FUNCTIONS[GyrostatParameters] = outputs_of

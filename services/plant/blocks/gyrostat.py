"""What is told of a gyrostat satellite: it turns about a fixed centre."""

from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.gyrostat import GyrostatParameters
from lapwing.dynamics.vehicles.rigid_body import RigidBody
from lapwing.kernels import always_inline
from lapwing.services.common.ports import TrueState
from lapwing.services.plant.blocks.uncontrolled import TOLD


@always_inline
def told(p: GyrostatParameters, t: float, x: RigidBody) -> tuple[TrueState]:
    """The attitude and its rate."""
    return (TrueState(ZERO, x.attitude, ZERO, x.omega_body, ZERO, (), (), (), (), (), (), ZERO, 0.0, False, ZERO),)


TOLD[GyrostatParameters] = told

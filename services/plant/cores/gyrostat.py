"""What is told of a gyrostat satellite: it turns about a fixed centre."""

from dynamics.kernel import leaf
from dynamics.vector import ZERO
from dynamics.vehicles.gyrostat import GyrostatParameters
from dynamics.vehicles.rigid_body import RigidBody
from services.common.ports import TrueState
from services.plant.cores.autonomous import TOLD


@leaf
def told(p: GyrostatParameters, t: float, x: RigidBody) -> tuple[TrueState]:
    """The attitude and its rate."""
    return (TrueState(ZERO, x.attitude, ZERO, x.omega_body, ZERO, (), (), (), (), (), (), ZERO, 0.0, False, ZERO),)


TOLD[GyrostatParameters] = told

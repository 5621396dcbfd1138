"""What is told of the crate that unloads its pack: the motion of the pack."""

from dynamics.kernel import leaf
from dynamics.vector import ZERO
from dynamics.vehicles.beer_carrier import BeerCarrierParameters, BeerCarrierState
from services.common.ports import TrueState
from services.plant.cores.autonomous import TOLD


@leaf
def told(p: BeerCarrierParameters, t: float, x: BeerCarrierState) -> tuple[TrueState]:
    """The pack's motion."""
    return (
        TrueState(
            x.position_world, x.attitude, x.velocity_world, x.omega_body, ZERO, (), (), (), (), (), (), ZERO, 0.0, False
        ),
    )


TOLD[BeerCarrierParameters] = told

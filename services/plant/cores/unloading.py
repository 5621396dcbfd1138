"""What is told of the crate that unloads its pack: the motion of the pack."""

from dynamics.kernel import leaf
from dynamics.vector import ZERO
from dynamics.vehicles.unloading import UnloadingParameters, UnloadingState
from services.common.ports import TrueState
from services.plant.cores.autonomous import TOLD


@leaf
def told(p: UnloadingParameters, t: float, x: UnloadingState) -> tuple[TrueState]:
    """The pack's motion."""
    return (
        TrueState(
            x.position_world,
            x.attitude,
            x.velocity_world,
            x.omega_body,
            ZERO,
            (),
            (),
            (),
            (),
            (),
            (),
            ZERO,
            0.0,
            False,
            ZERO,
        ),
    )


TOLD[UnloadingParameters] = told

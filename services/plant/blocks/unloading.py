"""Output of the crate that unloads its pack: the motion of the pack."""

from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.unloading import UnloadingParameters, UnloadingState
from lapwing.kernels import always_inline
from lapwing.services.common.ports import TrueState
from lapwing.services.plant.blocks.uncontrolled import OUTPUT_FUNCTIONS


@always_inline
def outputs_of(p: UnloadingParameters, t: float, x: UnloadingState) -> tuple[TrueState]:
    """Return the pack's motion."""
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


OUTPUT_FUNCTIONS[UnloadingParameters] = outputs_of

"""Fusion of satellite receiver readings: position, then velocity."""

from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.kernels import always_inline
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.estimator.blocks.navigation_state import NavigationState


class GpsFusion(NamedTuple):
    """Parameters of the block."""

    filter: Estimator
    age: int  # delay of a reading, in IMU readings
    height_variance: float  # [m^2] added to the height's variance; 0 for the height reference


@always_inline
def step(
    p: GpsFusion, s: NavigationState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[NavigationState, tuple[()], int]:
    """Correct the filter by the reading of the tick."""
    r, x = inputs[0].value, s.filter
    if s.started:
        east, north, up = r.position_variance
        position_variance = (east, north, up + p.height_variance)
        x = estimator.update_gps(
            p.filter, x, r.latitude_deg, r.longitude_deg, r.height, position_variance, p.age, r.valid
        )
        variance = r.velocity_variance if r.valid else -1.0
        x = estimator.update_gps_velocity(p.filter, x, r.velocity_world, variance, p.age, variance >= 0.0)
    return NavigationState(s.started, x), (), CONTINUE

"""Start of the filter at rest and prediction by IMU readings."""

import math
from typing import NamedTuple

from lapwing.cosim.diagram.compiled_block import CONTINUE, InputSample
from lapwing.dynamics.vector import Vec3, norm
from lapwing.kernels import always_inline
from lapwing.services.autopilot import estimator
from lapwing.services.autopilot.estimator import Estimator
from lapwing.services.autopilot.estimator.blocks.navigation_state import NavigationState
from lapwing.services.autopilot.land_detector import LANDED, ON_GROUND

STANDSTILL_RATIO = 0.02  # relative difference of specific force and gravity at rest
STANDSTILL_EVERY = 10  # IMU readings between two zero-velocity updates


class InertialNavigation(NamedTuple):
    """Parameters of the block."""

    filter: Estimator
    start_world: Vec3  # [m]
    standstill_every: int  # [ticks] between two zero-velocity updates


@always_inline
def step(
    p: InertialNavigation, s: NavigationState, tick: int, inputs: tuple[InputSample, ...]
) -> tuple[NavigationState, tuple[()], int]:
    """Start once the vehicle is at rest with a magnetometer reading; then predict to `tick`."""
    imu, magnetometer, flight = inputs
    r, started, x = imu.value, s.started, s.filter
    if not started:
        still = abs(norm(r.specific_force_body) - p.filter.gravity) < STANDSTILL_RATIO * p.filter.gravity
        if magnetometer.due and still:
            nothing = (math.nan, math.nan, math.nan)
            field = magnetometer.value.field_body if magnetometer.value.valid else nothing
            x = estimator.initial(p.filter, x.memory, p.start_world, r.specific_force_body, field)
            started = True
    if started:
        omega_variance = r.omega_variance if r.valid else -1.0
        force_variance = r.specific_force_variance if r.valid else -1.0
        valid = omega_variance >= 0.0 and force_variance >= 0.0
        cut = flight.due and flight.value.landed_state == LANDED
        x = estimator.predict(
            p.filter, x, r.omega_body, r.specific_force_body, omega_variance, force_variance, valid, cut
        )
        on_ground = not flight.due or (flight.value.landed_state == ON_GROUND and tick >= flight.value.still_from)
        if on_ground and tick % p.standstill_every == 0:
            x = estimator.update_standstill(p.filter, x, omega_variance, force_variance)
    return NavigationState(started, x), (), CONTINUE

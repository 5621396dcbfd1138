"""Cable of a shared load that becomes taut and slack within a step, against the closed form."""

import pytest

from lapwing.dynamics.effects.shared_slung_load import SharedSlungLoad
from lapwing.dynamics.integrators import get
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.terrain import LEVEL
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.multirotor_slung import Sling
from lapwing.services.common.schemas.run_schema import SHIPPED
from tests.dynamics.vehicles.rebound import rebound

QUAD = load_airframe(SHIPPED / "vehicles/quad_x.toml")
RK4 = get("rk4_renormalised").Method()
KEY = stream_key(1, "left", "plant")
RATIO, SPEED, SLACK, SECONDS, INTERVAL = 0.1, 1.5, 0.02, 0.5, 4e-3
FREQUENCY = 8.0  # [rad/s], so slow that RK4 has no error while the cable is taut


@pytest.mark.long
@pytest.mark.parametrize("steps", [1, 4])
def test_carrier_rebounds_from_taut_cable_as_damped_spring(steps):
    """Without weight and with a fixed load, every step is as accurate as the tolerance."""
    mass, length = QUAD.mass.total, 2.0
    sling = Sling(1.0, length, mass * FREQUENCY**2, 2.0 * RATIO * FREQUENCY * mass, ZERO, 0.0, LEVEL)
    p = multirotor.parameters(QUAD, (SharedSlungLoad(sling),))._replace(tolerance=1e-10)
    load = (0.0, 0.0, 100.0)
    state = multirotor.initial_state(p, (0.0, 0.0, 100.0 + length - SLACK), NO_ROTATION, 0.0, (0.0, 0.0, SPEED))
    state = state._replace(memory=((load, ZERO, ZERO, 0.0),))
    for tick in range(round(SECONDS / INTERVAL)):
        state = multirotor.advance(RK4, p, KEY, tick, state, (0.0,) * 4, INTERVAL / steps, steps)
    beyond, rate = rebound(SLACK, SPEED, FREQUENCY, RATIO, SECONDS)
    assert state.motion.position_world[2] - 100.0 - length == pytest.approx(beyond, abs=1e-7)
    assert state.motion.velocity_world[2] == pytest.approx(rate, abs=1e-7)

"""The plant against NASA's check cases (TM-2015-218675) that need no rotation of the Earth: 2, 4 and its atmosphere.

Figures of its tools by number, from their time histories (NESC Academy, as published with nasa/simupy-flight).
Case 1 falls over a rotating ellipsoid, and the damping of case 3 grows with the airspeed, unlike `rotational_drag`.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from lapwing.dynamics import effects
from lapwing.dynamics.atmosphere import EARTH_RADIUS, Atmosphere, density
from lapwing.dynamics.environment import Environment
from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.integrators import get
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe

pytestmark = pytest.mark.usefixtures("uncompiled")

DRONE = load_airframe(Path(__file__).parents[3] / "lapwing/scenes/vehicles/delivery_drone.toml")
FOOT, SLUG = 0.3048, 14.593902937
TOP = 30_000.0 * FOOT
RATES = {  # case 2: body rates after 30 s [deg/s], x forward, y right, z down
    1: (12.61839077566776, -17.3974747618308, 31.11958888682995),
    2: (12.619216961385067, -17.396709626714614, 31.119942061280724),
    4: (12.6183907757, -17.3974747619, 31.1195888868),
    5: (12.618423766019587, -17.397444101295715, 31.11960300607054),
    6: (12.620844062702608, -17.394550197091117, 31.12073831148526),
}
ALTITUDES = {  # case 4: height [ft] after 10, 20 and 30 s
    2: (28403.48476, 23710.53585, 16249.4161),
    4: (28401.2850443, 23701.9922296, 16231.3059243),
    5: (28401.285051796585, 23701.992393426597, 16231.30690887943),
    6: (28401.285202179104, 23701.99459792301, 16231.316664878279),
}
DENSITIES = {  # [slug/ft^3] at 30 000 ft and after a fall of 30 s without drag, at 15 598.904 ft
    1: (0.000891300230208, 0.00146840678864),
    2: (0.000890951, 0.001467602),
    4: (0.000890685451211, 0.00146718319468),
    5: (0.0008906867503799385, 0.001467186498706417),
    6: (0.0008907042526446323, 0.001467200302733287),
}


def fall(tables, mass, inertia, omega, environment, method, interval, every):
    """Return the motions of a body with its rotors at rest after each `every` of 30 seconds."""
    mass_properties = DRONE.mass.model_copy(update={"total": mass, "inertia": inertia})
    slow = DRONE.motor.model_copy(update={"time_constant": 10.0})  # of rotors at rest, so that no step is split
    body = DRONE.model_copy(update={"mass": mass_properties, "motor": slow})
    p = multirotor.parameters(body, effects.from_scene({"rotor_thrust": {}, **tables}, body, environment))
    state = multirotor.initial_state(p)
    state = state._replace(motion=state.motion._replace(omega_body=omega))
    result = []
    for tick in range(round(30.0 / interval)):
        state = multirotor.advance(get(method).Method(), p, (0, 0), tick, state, (0.0,) * 4, interval, 1)
        if (tick + 1) % round(every / interval) == 0:
            result.append(state.motion)
    return result


def assert_within(value, tools):
    assert min(tools) <= value <= max(tools), (value, tools)


@pytest.mark.long
def test_case_2_tumbling_brick():
    """Rates agree with the two tools that publish the most digits, and are within those of all."""
    inertia = tuple(i * SLUG * FOOT**2 for i in (0.001894220, 0.006211019, 0.007194665))
    omega = tuple(math.radians(w) for w in (10.0, -20.0, -30.0))  # z up
    (motion,) = fall({}, 0.155404754 * SLUG, inertia, omega, Environment(), "rk8_renormalised", 0.5, 30.0)
    rates = np.degrees(motion.omega_body) * (1.0, -1.0, -1.0)
    np.testing.assert_allclose(rates, RATES[4], atol=3e-8)
    for rate, tools in zip(rates, np.transpose(list(RATES.values())), strict=True):
        assert_within(round(rate, 7), np.round(tools, 7))


@pytest.mark.long
def test_case_4_dropped_sphere_with_drag():
    """The radius of the Earth is 20 902 255 ft, ours is smaller: gravity agrees in the middle of the fall."""
    middle, radius = 0.5 * (TOP + 16_231.0 * FOOT), 20_902_255.199 * FOOT
    at_middle = 32.1263120705 * FOOT * ((radius + TOP) / (radius + middle)) ** 2
    gravity = at_middle * ((EARTH_RADIUS + middle) / EARTH_RADIUS) ** 2
    area = 0.1 * 0.1963495 * FOOT**2
    tables = {"gravity_altitude": {}, "air_density": {}, "body_drag": {"area": (area, area, area)}}
    around = Environment(home=Home(0.0, 0.0, TOP), gravity=gravity)
    motions = fall(tables, SLUG, (3.6 * SLUG * FOOT**2,) * 3, (0.0, 0.0, 0.0), around, "rk4_renormalised", 0.25, 10.0)
    for motion, tools in zip(motions, np.transpose(list(ALTITUDES.values())), strict=True):
        altitude = (TOP + motion.position_world[2]) / FOOT
        assert_within(altitude, tools)
        assert altitude == pytest.approx(tools[1], abs=0.15)  # gravity is held for 0.25 s


@pytest.mark.parametrize(("altitude", "number"), [(30_000.0, 0), (15_598.904, 1)])
def test_density_of_the_atmosphere(altitude, number):
    value = density(Atmosphere(), altitude * FOOT) * FOOT**3 / SLUG
    assert_within(value, [row[number] for row in DENSITIES.values()])

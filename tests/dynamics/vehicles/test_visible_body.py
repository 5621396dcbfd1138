"""Rays on the body of a vehicle against points inside it, and its dimensions from an airframe."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lapwing.dynamics.lie.quaternion import NO_ROTATION, Quaternion
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.airframe_tables import CarriedBox
from lapwing.dynamics.vehicles.visible_body import HALF_HEIGHT, VisibleBody, distance_to_body, visible_body
from lapwing.services.common.schemas.run_schema import SHIPPED

pytestmark = pytest.mark.usefixtures("uncompiled")

BODY = VisibleBody(0.05, -0.1, 0.4, -0.3, 0.1)
STEP = 1e-3  # [m] of the samples along a ray
AT_HOME = (0.0, 0.0, 0.0)


def inside(points, position, rotation):
    """Return True for each point (n, 3) [m], world, inside the body."""
    x, y, z = rotation.inv().apply(points - position).T
    return (np.hypot(x - BODY.x, y - BODY.y) <= BODY.radius) & (BODY.bottom <= z) & (z <= BODY.top)


def first_inside(position, rotation, origin, direction):
    """Return the distance [m] to the first point inside the body, from samples and bisection."""
    at = np.arange(0.0, 6.0, STEP)
    hits = np.flatnonzero(inside(origin + at[:, None] * direction, position, rotation))
    if len(hits) == 0:
        return math.inf
    if hits[0] == 0:
        return 0.0
    low, high = at[hits[0]] - STEP, at[hits[0]]
    for _ in range(40):
        middle = 0.5 * (low + high)
        if inside(origin + np.array([[middle]]) * direction, position, rotation)[0]:
            high = middle
        else:
            low = middle
    return high


def test_distance_equals_first_sample_inside():
    """The samples miss chords below 1 mm: a few grazing rays may differ."""
    random, different, kinds = np.random.default_rng(3), 0, {"hit": 0, "miss": 0, "within": 0}
    for _ in range(600):
        rotation = Rotation.random(random_state=random)
        position = random.uniform(-5.0, 5.0, 3)
        origin = position + random.normal(size=3) * random.choice([0.2, 0.8])
        aim = position + random.normal(size=3) * 0.3 - origin
        direction = aim / np.linalg.norm(aim)
        if random.uniform() < 0.2:
            direction = -direction  # the body is behind
        x, y, z, w = rotation.as_quat()
        result = distance_to_body(BODY, tuple(position), Quaternion(w, x, y, z), tuple(origin), tuple(direction))
        expected = first_inside(position, rotation, origin, direction)
        kinds["miss" if result == math.inf else "within" if result == 0.0 else "hit"] += 1
        if result != expected:
            different += abs(result - expected) > 1e-9
    assert min(kinds.values()) > 30
    assert different <= 3


@pytest.mark.parametrize(
    ("origin", "direction", "expected"),
    [
        ((3.0, -0.1, 0.0), (-1.0, 0.0, 0.0), 3.0 - 0.45),  # side
        ((3.0, -0.1, 0.0), (1.0, 0.0, 0.0), math.inf),  # behind
        ((0.05, 0.1, 2.0), (0.0, 0.0, -1.0), 1.9),  # top, parallel to the axis
        ((0.05, 0.1, -2.0), (0.0, 0.0, 1.0), 1.7),  # bottom
        ((0.05, 0.31, 2.0), (0.0, 0.0, -1.0), math.inf),  # parallel to the axis, beside the body
        ((3.0, -0.1, 0.11), (-1.0, 0.0, 0.0), math.inf),  # above it
        ((3.0, 0.2999, 0.0), (-1.0, 0.0, 0.0), 3.0 - 0.05 - math.sqrt(0.16 - 0.3999**2)),  # grazing
        ((3.0, 0.3001, 0.0), (-1.0, 0.0, 0.0), math.inf),
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0),  # within
    ],
)
def test_distance_has_closed_form_when_upright(origin, direction, expected):
    assert distance_to_body(BODY, AT_HOME, NO_ROTATION, origin, direction) == pytest.approx(expected, abs=1e-12)


def test_attitude_turns_body_into_world():
    """A rotation by 90 degrees about y turns body z into world x: the top faces +x, the bottom -x."""
    half = math.sqrt(0.5)
    lying = Quaternion(half, 0.0, half, 0.0)
    assert distance_to_body(BODY, AT_HOME, lying, (2.0, -0.1, 0.0), (-1.0, 0.0, 0.0)) == pytest.approx(1.9)
    assert distance_to_body(BODY, AT_HOME, lying, (-2.0, -0.1, 0.0), (1.0, 0.0, 0.0)) == pytest.approx(1.7)


def test_body_encloses_rotors_and_feet():
    frame = load_airframe(SHIPPED / "vehicles" / "quad_x.toml").about_centre
    body = visible_body(frame)
    assert (body.x, body.y) == pytest.approx((0.0, 0.0))
    assert body.radius == pytest.approx(math.hypot(0.13, 0.22) + 0.128)
    assert (body.bottom, body.top) == pytest.approx((-0.11, 0.023 + HALF_HEIGHT * body.radius))


def test_airframe_without_feet_has_height_of_frame():
    frame = load_airframe(SHIPPED / "vehicles" / "quad_x.toml").model_copy(update={"contact": None})
    body = visible_body(frame)
    assert body.top - body.bottom == pytest.approx(2.0 * HALF_HEIGHT * body.radius)
    assert 0.5 * (body.top + body.bottom) == pytest.approx(0.023)


def test_body_encloses_payload_and_rotors_about_centre_of_mass():
    frame = load_airframe(SHIPPED / "vehicles" / "quad_x.toml")
    box = CarriedBox(mass=0.5, position=(0.3, 0.0, -0.5), size=(0.2, 0.2, 0.4))
    carrying = frame.model_copy(update={"payload": box}).loaded.about_centre
    centre = carrying.payload.position[0] - 0.3  # of the former origin, from the common centre of mass
    body = visible_body(carrying)
    assert body.x == pytest.approx(centre)
    assert body.radius == pytest.approx(max(math.hypot(0.4, 0.1), math.hypot(0.13, 0.22) + 0.128))
    assert body.bottom == pytest.approx(carrying.payload.position[2] - 0.2)

"""Jet below a vehicle against momentum theory and conservation of momentum."""

import math
from pathlib import Path

import numpy as np
import pytest

from lapwing.dynamics.effects import from_scene
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.effects.downwash import wind_of_jets
from lapwing.dynamics.vehicles.airframe import load_airframe

pytestmark = pytest.mark.usefixtures("uncompiled")

ROOT = Path(__file__).parents[3]
QUAD = load_airframe(ROOT / "lapwing/scenes/vehicles/quad_x.toml")
WASH = from_scene({"downwash": {}}, QUAD)[0]
NO_WIND = (0.0, 0.0, 0.0)
WEIGHT, DENSITY = 1.5 * 9.80665, 1.2
R = WASH.disc_radius
INDUCED = math.sqrt(WEIGHT / (2.0 * DENSITY * math.pi * R * R))  # momentum theory


def hovering(thrust=(0.0, 0.0, WEIGHT), disc_radius=R):
    return NeighbourState((1.0, 2.0, 50.0), NO_WIND, thrust, 1.5, DENSITY, disc_radius=disc_radius)


def wind(offset, *others):
    place = tuple(float(a + b) for a, b in zip((1.0, 2.0, 50.0), offset, strict=True))
    return np.array(wind_of_jets(WASH, NO_WIND, NeighbourState(place), others or (hovering(),), 0.004))


def test_disc_area_is_sum_of_four_rotors():
    assert math.pi * R * R == pytest.approx(4.0 * math.pi * 0.128**2)


def test_axial_velocity_doubles_and_jet_spreads():
    assert wind((0.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, -INDUCED))
    assert np.linalg.norm(wind((0.0, 0.0, 10.0 * R))) < 0.01 * INDUCED  # above
    for way in (5.0, 20.0):
        developed = 1.0 + way / math.hypot(way, R)
        expected = developed * INDUCED * R / (R + 0.113 * way)
        assert wind((0.0, 0.0, -way)) == pytest.approx((0.0, 0.0, -expected))


def test_half_width_equals_round_jet_of_pope():
    """The half width grows by 0.094 m per metre, far from the disc."""
    far = 1000.0
    half = 0.094 * (far + R / 0.113)
    assert wind((half, 0.0, -far))[2] == pytest.approx(0.5 * wind((0.0, 0.0, -far))[2], rel=0.01)


@pytest.mark.parametrize("way", [3.0, 10.0])
def test_wake_momentum_equals_thrust(way):
    """The reference is the flux of momentum through a plane below."""
    radius = np.linspace(0.0, 6.0 * (R + 0.113 * way), 2001)
    speed = np.array([-wind((r, 0.0, -way))[2] for r in radius])
    flux = np.trapezoid(DENSITY * speed**2 * 2.0 * math.pi * radius, radius)
    developed = 0.5 * (1.0 + way / math.hypot(way, R))
    assert flux == pytest.approx(WEIGHT * developed**2, rel=1e-5)
    assert flux == pytest.approx(WEIGHT, rel=0.01)


def test_wake_opposes_thrust_and_wakes_add_up():
    leaning = hovering((WEIGHT, 0.0, 0.0))
    assert wind((-2.0, 0.0, 0.0), leaning)[0] < -0.5 * INDUCED
    assert wind((2.0, 0.0, 0.0), leaning) == pytest.approx((0.0, 0.0, 0.0), abs=0.02 * INDUCED)
    assert wind((0.0, 0.0, -3.0), hovering(), hovering()) == pytest.approx(2.0 * wind((0.0, 0.0, -3.0)))


def test_no_jet_without_thrust_or_disc():
    assert not wind((0.0, 0.0, -1.0), hovering(NO_WIND), hovering(disc_radius=0.0)).any()


OPPOSITE = 2.0 * math.hypot(0.13, 0.22)  # [m] the largest distance between rotors


def axial(core, way):
    wash = from_scene({"downwash": {"core": core}}, QUAD)[0]
    place = NeighbourState((1.0, 2.0, 50.0 - way))
    return -wind_of_jets(wash, NO_WIND, place, (hovering(),), 0.004)[2]


def test_jet_spreads_only_beyond_its_core():
    """2.5 distances of opposite rotors: developed wake above, jet of the same momentum below."""
    core = 2.5 * OPPOSITE
    for way in (0.5 * core, core):
        assert axial(2.5, way) == pytest.approx(INDUCED * (1.0 + way / math.hypot(way, R)))
    assert axial(2.5, core + 3.0) == pytest.approx(2.0 * INDUCED * R / (R + 0.113 * 3.0), rel=1e-3)
    assert axial(2.5, core + 3.0) > axial(0.0, core + 3.0)


@pytest.mark.parametrize(("published", "difference"), [(6.06, 0.04), (5.8, 0.08)])
def test_far_field_follows_published_decay(published, difference):
    """U = B sqrt(4 T / pi rho) / (x - x_0): Panchapakesan and Lumley 6.06, Hussein, Capp and George 5.8 (Pope, 5.1)."""
    origin = 2.5 * OPPOSITE - R / 0.113
    for way in (20.0, 60.0, 200.0):
        expected = published * math.sqrt(4.0 * WEIGHT / (math.pi * DENSITY)) / (way - origin)
        assert axial(2.5, way) == pytest.approx(expected, rel=difference)
        assert axial(2.5, way) > expected

"""Rotor interference against published slopes, limits, a flow survey around a rotor, and tandem momentum theory."""

import math

import numpy as np
import pytest
from effects_helpers import NO_FACTORS, NO_LOADS
from scipy.integrate import quad
from scipy.optimize import brentq

from lapwing.dynamics import effects
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects.rotor_interference import OFFSETS, SKEWS, mean_wash, normal_flow, rotor_interference
from lapwing.dynamics.effects.rotor_thrust import rotor_thrust

SPEED, DENSITY = 330.0, 1.2


def make(drone):
    tables = {"rotor_thrust": {}, "rotor_interference": {}}
    return effects.from_scene(tables, drone)


def changes(drone, s):
    """Return relative changes of thrust and torque of each rotor from the static loads."""
    e, static = make(drone)
    before = rotor_thrust.py_func(static, (), s, NO_FACTORS, NO_LOADS)
    after = rotor_interference.py_func(e, (), s, NO_FACTORS, before)
    return tuple(np.array(a) / np.array(b) - 1.0 for a, b in zip(after, before, strict=True))


@pytest.mark.parametrize("degrees", [10.0, 45.0, 70.0, 82.0])
def test_flow_grows_downstream_as_published(degrees):
    """Coleman, Feingold and Stempin: v = v_0 (1 + tan(chi / 2) x / R) near the centre, at every skew."""
    chi, h = math.radians(degrees), 1e-4
    tangent = math.tan(chi)
    slope = (normal_flow(tangent, h, 0.0, 0.0) - normal_flow(tangent, -h, 0.0, 0.0)) / (2.0 * h)
    assert normal_flow(tangent, 0.0, 0.0, 0.0) == pytest.approx(1.0)
    assert slope == pytest.approx(math.tan(0.5 * chi), rel=1e-4)


def test_flow_below_hovering_rotor_follows_vortex_cylinder():
    for depth in (0.0, 0.5, 2.0, 10.0):
        assert normal_flow(0.0, 0.0, 0.0, -depth) == pytest.approx(1.0 + depth / math.hypot(depth, 1.0))
    assert normal_flow(0.0, 2.5, 0.0, 0.0) == pytest.approx(0.0, abs=1e-12)  # beside it


def test_flow_far_downstream_is_doubled():
    assert normal_flow(5.0, 40.0, 0.0, -8.0) == pytest.approx(2.0, abs=2e-3)


def test_flow_behind_rotor_against_survey():
    """Heyson and Katzoff, NACA TR 1319, as read by Prouty for a stabiliser: 1.5, at a skew of 87.7 degrees."""
    computed = normal_flow(1.0 / 0.0405, 1.08, 0.0, -0.3)
    assert computed == pytest.approx(1.5, rel=0.13)  # theory, section 2.12: 1.68; the survey's disc was not uniform


def test_flow_against_integral_along_wake():
    """The reference sums Biot-Savart ring by ring, without the closed form along the wake."""
    tangent, x, y, z = 1.5, 1.7, 0.6, 0.1
    length = math.hypot(1.0, tangent)
    ex, ez = tangent / length, -1.0 / length
    azimuth = (np.arange(180) + 0.5) * 2.0 * math.pi / 180

    def ring(distance):
        sx, sy, sz = x - np.cos(azimuth) - distance * ex, y - np.sin(azimuth), z - distance * ez
        return np.mean((np.sin(azimuth) * sy + np.cos(azimuth) * sx) / (sx**2 + sy**2 + sz**2) ** 1.5)

    total = sum(quad(ring, a, b, epsabs=1e-10)[0] for a, b in ((0.0, 5.0), (5.0, 50.0), (50.0, 5000.0)))
    assert -total == pytest.approx(normal_flow(tangent, x, y, z), abs=1e-7)


def test_mean_over_disc_is_accurate():
    """64 points are compared with 1536; the theory lists the largest difference."""
    rings, places = 16, 96
    worst = 0.0
    for skew in (0.5, 0.75, 1.0):
        for offset in OFFSETS[::2]:
            cosine = 1.0 - 2.0 * offset**2
            x, y = 2.52 * cosine, 2.52 * math.sqrt(1.0 - cosine**2)
            tangent = min(skew / max(1.0 - skew, 1e-9), 8.0)
            r = np.sqrt((np.arange(rings) + 0.5) / rings)
            a = 2.0 * math.pi * (np.arange(places) + 0.4) / places
            dense = np.mean(
                [[normal_flow(tangent, x + q * math.cos(b), y + q * math.sin(b), 0.0) for b in a] for q in r]
            )
            worst = max(worst, abs(dense - mean_wash(skew, offset, 2.52)))
    assert worst < 0.02


@pytest.mark.long
def test_hover_is_unchanged(drone, situation):
    thrust, torque = changes(drone, situation(speed=(SPEED,) * 4))
    assert thrust == pytest.approx([0.0] * 4, abs=1e-12)
    assert torque == pytest.approx([0.0] * 4, abs=1e-12)


def test_rear_rotors_lose_thrust_in_forward_flight(drone, situation):
    thrust, torque = changes(drone, situation(speed=(SPEED,) * 4, velocity=(12.0, 0, 0)))
    front, rear = thrust[[0, 3]], thrust[[1, 2]]
    assert rear == pytest.approx([rear[0]] * 2)
    assert rear[0] < -0.03
    assert (front > 0.0).all()  # the rear rotors' upwash
    assert (torque[[1, 2]] > rear).all()


def test_loss_turns_with_direction_of_flight(drone, situation):
    ahead, _ = changes(drone, situation(speed=(SPEED,) * 4, velocity=(12.0, 0, 0)))
    aside, _ = changes(drone, situation(speed=(SPEED,) * 4, velocity=(0, 12.0, 0)))
    blown, _ = changes(drone, situation(speed=(SPEED,) * 4, wind=(-12.0, 0, 0)))
    assert aside == pytest.approx(np.roll(ahead, 1), abs=1e-12)
    assert blown == pytest.approx(ahead, abs=1e-12)


def test_blades_and_discs_agree(drone, situation):
    """Independent solution of slope w (P w - V - v - u) = 2 A v sqrt(V_xy^2 + (V + v)^2), u: flow of other rotors."""
    e, _ = make(drone)
    s = situation(speed=(SPEED,) * 4, velocity=(12.0, 0, 0))
    thrust, _ = changes(drone, s)
    pitch = drone.propeller.pitch / (2.0 * math.pi) * SPEED

    def disc(v):
        return 2.0 * e.area * v * math.hypot(12.0, v)

    v0 = brentq(lambda v: disc(v) - e.thrust_constant * SPEED**2, 0.0, 20.0)
    base = e.thrust_constant * SPEED**2 - e.slope * SPEED * (pitch - v0)  # so that the static loads are kept

    def solved(flow):
        v = brentq(lambda v: disc(v) - base - e.slope * SPEED * (pitch - v - flow), 0.0, 20.0)
        return disc(v) / (e.thrust_constant * SPEED**2) - 1.0

    shares = []
    for k, row in enumerate(e.pairs):
        total = 0.0
        for x, _, table in row:
            if table >= 0:
                skew = np.interp(12.0 / (12.0 + v0), SKEWS, np.arange(9.0))
                offset = np.interp(math.sqrt(0.5 + 0.5 * x), OFFSETS, np.arange(13.0))
                i, j = min(int(skew), 7), min(int(offset), 11)
                block = e.wash[table, i : i + 2, j : j + 2]
                total += np.array([1 - skew + i, skew - i]) @ block @ np.array([1 - offset + j, offset - j])
        shares.append(total)
        assert thrust[k] == pytest.approx(solved(total * v0), rel=0.15, abs=1e-4)
    assert shares[1] > 0.1 > shares[0]


def test_coaxial_rotors_and_other_models_are_rejected(drone):
    over = drone.rotors.model_copy(update={"position": ((0.3, 0, 0), (0.3, 0, 0.1), (-0.3, 0, 0), (-0.3, 0, 0.1))})
    with pytest.raises(ConfigError, match=r"coaxial rotors; use effects.coaxial_interference"):
        make(drone.model_copy(update={"rotors": over}))
    with pytest.raises(ConfigError, match=r"needs effects.rotor_thrust"):
        effects.from_scene({"rotor_interference": {}}, drone)

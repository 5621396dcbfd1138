"""Wakes: downwash on other vehicles, and on rotors below."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import lapwing
from lapwing.dynamics import effects
from lapwing.dynamics.effects import from_scene
from lapwing.dynamics.effects._vehicle_interaction import NeighbourState
from lapwing.dynamics.effects.downwash import wind_of_jets
from lapwing.dynamics.lie.quaternion import exp
from lapwing.dynamics.vehicles import multirotor
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.inflow import thrust_in_wake
from lapwing.dynamics.vehicles.multirotor_equations import StepInputs, evaluate
from lapwing.kernels import python_function

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


share = python_function(thrust_in_wake)
GAP = 0.10  # [m]


def stacked(drone, aside=0.0, gap=GAP):
    """Return an airframe with a counter-rotating rotor above each rotor."""
    r = drone.rotors
    hubs = tuple((x + dx, y, z) for x, y, _ in r.position for dx, z in ((0.0, 0.0), (aside, gap)))
    spins = tuple(way for spin in r.spin_direction for way in (spin, "cw" if spin == "ccw" else "ccw"))
    return drone.model_copy(update={"rotors": r.model_copy(update={"position": hubs, "spin_direction": spins})})


def through(pitch, thrust):
    """Return the flow through the lower rotor over its induced flow, from the thrust of its blades."""
    return pitch - (pitch - 1.0) * thrust


@pytest.mark.parametrize("pitch", [1.2, 1.55, 2.0, 3.5])
def test_coaxial_induced_power_is_1_28_times_isolated(pitch):
    """Leishman, on coaxial rotors: 1.281; the lower one alone takes (sqrt 17 - 1) / 2 = 1.562 times the upper's."""
    wash = brentq(lambda w: w * w - share(pitch, w), 1e-3, pitch)  # thrust over thrust is the square of the wash
    lower = through(pitch, share(pitch, wash)) / wash
    assert lower == pytest.approx(0.5 * (math.sqrt(17.0) - 1.0), rel=1e-9)
    assert 0.5 * (1.0 + lower) == pytest.approx(1.281, abs=5e-4)


def test_at_equal_torques_upper_rotor_carries_more():
    """From u = v + w: T u = T_u v and conservation of momentum and energy, (1 + u)^2 = 2 u^3; T_u / T = u = 1.4376."""
    u = brentq(lambda u: 2.0 * u**3 - (1.0 + u) ** 2, 1.0, 2.0)
    pitch = 1.7
    wash = brentq(lambda w: w**3 - share(pitch, w) * through(pitch, share(pitch, w)), 1e-3, 1.4)
    assert wash**2 / share(pitch, wash) == pytest.approx(u, rel=1e-9)


def test_thrust_loss_without_wake_and_with_wake_at_pitch_speed():
    assert share(1.5, 0.0) == 1.0
    assert share(1.5, 1.5 - 1e-9) == pytest.approx(0.0, abs=1e-6)
    assert share(1.5, 2.0) == 0.0


def loads(frame, tables, velocity=(0.0, 0.0, 0.0), speeds=(300.0,) * 8, turn=(0.0, 0.0, 0.0)):
    p = multirotor.parameters(frame, effects.from_scene(tables, frame))
    state = multirotor.initial_state(p, (0.0, 0.0, 50.0), exp(turn), 0.0, velocity)
    motion = state.motion._replace(rotor_speed=speeds)
    u = StepInputs(p, p.body, state.memory, (0.0,) * 8)
    rotors = python_function(evaluate)(u, 0.0, motion)[1]
    return np.array(rotors.thrust), np.array(rotors.torque)


def test_lower_rotor_loses_thrust_and_upper_does_not(drone):
    """Thrust and induced power of the lower rotor follow momentum theory; its profile power is unchanged."""
    frame = stacked(drone)
    plain, drag = loads(frame, {"rotor_thrust": {}})
    thrust, torque = loads(frame, {"rotor_thrust": {}, "coaxial_interference": {}})
    e, _ = effects.from_scene({"rotor_thrust": {}, "coaxial_interference": {}}, frame)
    assert thrust[1::2] == pytest.approx(plain[1::2], rel=1e-15)
    assert torque[1::2] == pytest.approx(drag[1::2], rel=1e-15)
    t = thrust[0] / plain[0]
    assert t == pytest.approx(share(e.pitch, 1.0), rel=1e-12)
    area, rho, v = math.pi * e.radius**2, 1.225, e.flow * 300.0
    u = through(e.pitch, t) * v
    w = (thrust[0] + 2.0 * rho * area * v * v) / (rho * area * u)  # far below: momentum
    power = 0.5 * rho * area * u * w * w - 2.0 * rho * area * v**3  # power of its disc: energy
    assert thrust[0] * u == pytest.approx(power, rel=1e-9)
    assert (torque - drag)[0] * 300.0 == pytest.approx(thrust[0] * u - plain[0] * v, rel=1e-9)


def test_lost_upper_propeller_has_no_wake(drone):
    tables = {"rotor_thrust": {}, "coaxial_interference": {}}
    stopped = loads(stacked(drone), tables, speeds=(300.0, 0.0) * 4)[0]
    assert stopped[::2] == pytest.approx(loads(stacked(drone), {"rotor_thrust": {}})[0][::2])


def test_fast_flight_carries_wake_away(drone):
    frame, tables = stacked(drone), {"rotor_thrust": {}, "coaxial_interference": {}}
    result = [loads(frame, tables, (v, 0.0, 0.0))[0][0] for v in (0.0, 10.0, 20.0, 60.0)]
    assert np.all(np.diff(result) >= 0.0)
    assert result[-1] == pytest.approx(loads(frame, {"rotor_thrust": {}})[0][0])


BOTH = {"rotor_thrust": {}, "coaxial_interference": {}}


def test_slopes_equal_differences_of_plant_loads(drone):
    """The reference is central differences of the plant's loads over the loads of isolated rotors."""
    frame = stacked(drone)
    e, rotor = effects.from_scene(BOTH, frame)
    slopes, k = e.slopes(), 1.225 * rotor.thrust_constant
    alone, d = k * 300.0**2, 1e-4
    for j in range(8):
        shifted = [alone * (1.0 + sign * d * np.eye(8)[j]) for sign in (1.0, -1.0)]
        more, less = (loads(frame, BOTH, speeds=tuple(np.sqrt(thrust / k))) for thrust in shifted)
        thrust, torque = ((a - b) / (2.0 * d * alone) for a, b in zip(more, less, strict=True))
        own = rotor.torque_constant / rotor.thrust_constant * np.eye(8)[j]
        assert np.array(slopes.thrust)[:, j] == pytest.approx(thrust, abs=1e-7)
        assert np.array(slopes.torque)[:, j] + own == pytest.approx(torque, abs=1e-8)


def test_slopes_reproduce_loads_at_equal_rotor_speeds(drone):
    """Euler's theorem: loads are homogeneous in the squares of the speeds."""
    e, _ = effects.from_scene(BOTH, stacked(drone))
    slopes, t = e.slopes(), share(e.pitch, 1.0)
    assert np.array(slopes.thrust).sum(axis=1) == pytest.approx([t, 1.0] * 4, rel=1e-12)
    gained = e.flow * (t * through(e.pitch, t) - 1.0)
    assert np.array(slopes.torque).sum(axis=1) == pytest.approx([gained, 0.0] * 4, rel=1e-12)


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (9.0, 0.0, 2.0), (0.0, 4.0, -1.0)])
def test_load_changes_equal_those_of_plant(drone, velocity):
    frame = stacked(drone)
    e, _ = effects.from_scene(BOTH, frame)
    across, axial = math.hypot(*velocity[:2]), velocity[2]
    with_wash, without = loads(frame, BOTH, velocity), loads(frame, {"rotor_thrust": {}}, velocity)
    result = 1.225 * np.array(e.changes(300.0, axial, across)).T
    assert result == pytest.approx(np.array(with_wash) - np.array(without), abs=1e-10)


@pytest.mark.parametrize(
    ("frame", "tables", "message"),
    [
        (lambda d: d, {}, "effects.coaxial_interference: the vehicle has no coaxial rotors"),
        (lambda d: stacked(d, aside=0.2), {}, "effects.coaxial_interference: the vehicle has no coaxial rotors"),
        (lambda d: stacked(d, gap=0.7), {}, "effects.coaxial_interference: the vehicle has no coaxial rotors"),
        (stacked, {"dynamic_inflow": {}}, "effects.coaxial_interference: cannot be combined with effects.dynamic"),
    ],
)
def test_invalid_combinations_are_rejected(drone, frame, tables, message):
    with pytest.raises(ValueError, match=message):
        effects.from_scene({"rotor_thrust": {}, "coaxial_interference": {}, **tables}, frame(drone))


def test_effect_without_rotor_thrust_is_rejected(drone):
    with pytest.raises(ValueError, match=r"effects.coaxial_interference: needs effects\.rotor_thrust"):
        effects.from_scene({"coaxial_interference": {}}, stacked(drone))


@pytest.mark.long
def test_eight_rotors_in_four_pairs_hover_and_land(drone):
    """At twice the mass on twice the rotors the upper ones carry more, as theory predicts from their speeds."""
    frame = stacked(drone)
    rotors = {"position": [list(p) for p in frame.rotors.position], "spin_direction": list(frame.rotors.spin_direction)}
    flight = lapwing.fly(
        "hover",
        {"airframe.mass.total": 12.0, "airframe.mass.payload": 0.0, "airframe.mass.inertia": [0.54, 0.52, 0.84],
         "airframe.rotors.position": rotors["position"], "airframe.rotors.spin_direction": rotors["spin_direction"],
         "effects.coaxial_interference": {}},
    )  # fmt: skip
    assert flight.landed
    thrust = flight.truth.rotor_thrust[(flight.truth.times > 5.0) & (flight.truth.times < 6.0)].mean(axis=0)
    assert thrust.sum() == pytest.approx(12.0 * 9.80665, rel=5e-3)
    e, _ = effects.from_scene({"rotor_thrust": {}, "coaxial_interference": {}}, frame)
    assert thrust[::2].sum() / thrust[1::2].sum() == pytest.approx(share(e.pitch, 1.0), rel=0.02)

"""Tension of the links of a load: Lagrange multipliers of free particles, a hover, and events of pushes."""

import numpy as np
import pytest
import synthetic_flights

from lapwing.flights.tension import pushes, tension

LOAD = {"quad_mass": (0.7, 0.9), "link_length": (0.6, 0.8), "load_mass": 0.4, "gravity": 9.81}
MASS = np.array([0.4, 0.7, 0.9])


def multipliers(r, v, force):
    """Return the link tensions [N] as Lagrange multipliers of |r_i - r_0| = L_i, free particles."""
    d, dv = r[1:] - r[0], v[1:] - v[0]
    jacobian = np.zeros((2, 9))
    for i in range(2):
        jacobian[i, :3], jacobian[i, 3 + 3 * i : 6 + 3 * i] = -d[i], d[i]
    outside = np.vstack([np.zeros(3), force])
    outside[:, 2] -= MASS * LOAD["gravity"]
    saddle = np.block([[np.diag(np.repeat(MASS, 3)), jacobian.T], [jacobian, np.zeros((2, 2))]])
    result = np.linalg.solve(saddle, np.concatenate([outside.ravel(), -(dv**2).sum(axis=1)]))
    return result[9:] * np.linalg.norm(d, axis=1)


def test_tension_equals_lagrange_multipliers():
    rng = np.random.default_rng(3)
    for _ in range(5):
        q = rng.normal(size=(2, 3))
        q /= np.linalg.norm(q, axis=1)[:, None]
        swing = np.cross(rng.normal(size=(2, 3)), q)
        length = np.array(LOAD["link_length"])[:, None]
        r, v = np.vstack([np.zeros(3), -length * q]), rng.normal(size=3) + np.vstack([np.zeros(3), -length * swing])
        force = rng.normal(size=(2, 3)) * 8.0
        result = tension(r[None], v[None], force[None], LOAD)[0]
        assert result == pytest.approx(multipliers(r, v, force), abs=1e-11)


def flight(thrust):
    """Return a flight with vertical links and level quadrotors, which each carry half of the load in hover."""
    place = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.6], [0.0, 0.0, 0.8]])
    bodies = {"pose": np.broadcast_to(np.hstack([place, np.tile(synthetic_flights.LEVEL, (3, 1))]), (100, 3, 7))}
    bodies["velocity"] = np.zeros((100, 3, 3))
    topics = {
        "ground_truth": {"pose.position": (0.0, 0.0, 0.0)},
        "body_states": bodies,
        "rotor_wrench": {"thrust": thrust},
    }
    return synthetic_flights.flight(100, scene={"cooperative_load": LOAD}, **topics)


def hover(t):
    """Return thrusts [N] at times t [s], shape (n, 2): hover until 0.5 s, then link 2 is in compression."""
    own = np.array([0.7, 0.9]) * 9.81
    return np.where(t[:, None] < 0.5, own + 0.2 * 9.81, own * [1.6, 0.0])


def test_pushing_link_event_has_name_time_and_force():
    result = flight(hover(np.arange(100) / 100)).events
    assert [(event.kind, event.text[:6]) for event in result] == [("slack", "link 2")]
    assert 0.49 < result[0].time < 0.5
    assert flight(hover(np.zeros(100))).events == []


def test_push_has_begin_end_and_largest_force():
    t = np.arange(5.0)
    assert pushes(t, np.array([3.0, 1.0, -1.0, -2.0, 4.0])) == [(1.5, 3.0, 2.0)]
    assert pushes(t, np.ones(5)) == []

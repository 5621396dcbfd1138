"""Contacts of synthetic flights: which body was touched, when and how fast."""

import numpy as np
import pytest
import synthetic_flights

from lapwing.flights.contacts import contacts

TICKS, RATE = 400, 100
T = np.arange(TICKS) / RATE
TERRAIN = {
    "slope": (0.0, 0.0),
    "box": [
        {"position": (50.0, 0.0), "size": (2.0, 2.0), "top": 9.0, "heading": 0.0},
        {"position": (5.0, 0.0), "size": (4.0, 8.0), "top": 3.0, "heading": 0.0},
    ],
    "cylinder": [{"position": (0.0, 6.0), "radius": 1.0, "top": 9.0, "name": "water tower"}],
    "steps": {"distance": [20.0], "rise": [1.0], "heading": np.pi},
}
SCENE = {
    "environment": {"terrain": TERRAIN},
    "effects": {"ground_contact": {}},
    "airframe": {
        "contact": {"feet": [(0.1, 0.1, -0.2), (-0.1, -0.1, -0.2)], "hull": [(0.5, 0.0, 0.0), (0.0, 0.5, 0.0)]},
        "rotors": {"position": [(0.5, 0.0, 0.0)]},
        "propeller": {"diameter": 0.4},
    },
}


def touches(x, y=0.0, z=2.0, contact=False, scene=SCENE, others=()):
    """Return (body, face, time, speed, height) of the contacts on a level path [m] over T."""
    position = np.column_stack(np.broadcast_arrays(x, y, z, T)[:3])
    truth = {
        "pose.position": position,
        "pose.orientation": synthetic_flights.LEVEL,
        "velocity": RATE * np.diff(position, axis=0, prepend=position[:1]),
        "ground_contact": np.broadcast_to(contact, T.shape),
    }
    view = synthetic_flights.flight(TICKS, RATE, ground_truth=truth).truth
    neighbours = {name: (synthetic_flights.flight(TICKS, RATE, ground_truth=of).truth, scene) for name, of in others}
    found = contacts(view, scene, neighbours)
    return [(c.body, c.face, float(view.times[c.start]), round(c.speed, 6), round(c.height, 6)) for c in found]


def approach(distance, speed=2.0):
    """Return a path to `distance` [m] and back, at a speed [m/s]."""
    return distance - speed * abs(T - 2.0)


def test_hull_that_meets_wall_between_two_ticks_hits_it():
    # the hull, 0.5 m ahead, would be 5 mm inside the wall at 3 m at the next tick, but has bounced
    (touch,) = touches(approach(2.495))
    assert touch == ("building 2", "wall", pytest.approx(2.01), 2.0, 1.8)
    assert touches(approach(2.45)) == []


def test_roof_is_landed_on_with_downward_speed():
    (touch,) = touches(5.0, z=3.2 + np.maximum(0.0, 1.0 - 0.5 * T), contact=T >= 2.0)
    assert touch[:2] == ("building 2", "roof")
    assert touch[2] == pytest.approx(2.0, abs=0.011)
    assert touch[3] == 0.5
    assert touches(5.0, z=3.7) == []


def test_tower_has_its_name_and_step_its_number():
    assert [touch[:2] for touch in touches(0.0, y=approach(4.55), z=4.0)] == [("water tower", "wall")]
    assert [touch[:2] for touch in touches(-19.0 - approach(0.95), z=0.9)] == [("step 1", "wall")]


def test_contact_that_no_obstacle_explains_is_that_of_the_ground():
    (touch,) = touches(0.0, z=0.2 + np.maximum(0.0, 1.0 - 0.5 * T), contact=T >= 2.0)
    assert touch == ("the ground", "", 2.0, 0.5, 0.0)


@pytest.mark.parametrize("slope", [0.0, 0.1])
def test_foot_that_bounces_between_two_ticks_touches_the_ground(slope):
    """A stiff foot stays on the ground for less than a tick, so that the log has no contact."""
    terrain = {key: value for key, value in TERRAIN.items() if key != "steps"} | {"slope": (slope, 0.0)}
    scene = SCENE | {"environment": {"terrain": terrain}}
    path = 0.202 + slope * 2.1 + 0.6 * abs(T - 2.0)  # the foot ahead turns 2 mm above the ground
    assert touches(2.0, y=-3.0, z=path, scene=scene) == [("the ground", "", pytest.approx(2.01), 0.6, 0.0)]
    assert touches(2.0, y=-3.0, z=path + 0.01, scene=scene) == []


def test_obstacles_without_contact_model_are_no_bodies():
    assert touches(approach(6.0), scene=SCENE | {"effects": {}}) == []


def test_vehicles_touch_with_relative_speed_unless_they_shall_not():
    other = {
        "pose.position": np.column_stack([2.0 + 1.0 * T, 0.0 * T, 20.0 + 0.0 * T]),
        "pose.orientation": synthetic_flights.LEVEL,
        "velocity": (1.0, 0.0, 0.0),
        "ground_contact": False,
    }
    colliding = SCENE | {"effects": {"collision": {}}}
    (touch,) = touches(2.0 * T - 1.0, z=20.0, scene=colliding, others=[("right", other)])
    # spheres of 0.7 m, 3 m apart at the start, approach at 1 m/s
    assert touch == ("vehicle right", "", pytest.approx(1.6), 1.0, 19.8)
    (through,) = touches(2.0 * T - 1.0, z=20.0, others=[("right", other)])
    assert through[:3] == ("vehicle right", "", pytest.approx(1.6))
    assert (
        touches(2.0 * T - 1.0, z=20.0, scene=SCENE | {"effects": {"collision": False}}, others=[("right", other)]) == []
    )

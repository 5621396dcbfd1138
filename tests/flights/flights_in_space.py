"""Synthetic flights for the 3D view, and a fake viser scene."""

import copy

import numpy as np
import synthetic_flights

from lapwing.flights.flight_data import FlightData
from lapwing.flights.topic_view import TopicView

TICKS, RATE = 400, 100
T = np.arange(TICKS) / RATE
HUBS = [[0.3, 0.3, 0.0], [-0.3, 0.3, 0.0], [-0.3, -0.3, 0.0], [0.3, -0.3, 0.0]]
AIRFRAME = {
    "rotors": {"position": HUBS, "spin_direction": ["cw", "ccw", "cw", "ccw"]},
    "propeller": {"diameter": 0.5},
    "contact": {"feet": [[0.2, 0.2, -0.3]]},
    "mass": {"payload": 2.0},
}
READY = """
    const until = async (holds) => {
      for (let k = 0; k < 1200 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
      if (!holds()) throw new Error(`never: ${holds}`);
    };
    await until(() => document.readyState === "complete" && window.lapwingView && lapwingView.ready);
"""


def flight(model="rigid_body", ticks=TICKS, scene=None, **topics):
    """Return a climb at 1 m/s with rotors at 1 rad/s and wind of 3 m/s along x."""
    t = np.arange(ticks) / RATE
    truth = {
        "pose.position": np.column_stack([0.0 * t, 0.0 * t, t]),
        "pose.orientation": synthetic_flights.LEVEL,
        "rotor_speed": (1.0,) * 4,
        **dict.fromkeys(("motor_voltage", "motor_current", "motor_power", "rotor_thrust", "rotor_torque"), (1.0,) * 4),
        "velocity": (0.0, 0.0, 1.0),
        "acceleration": (0.0,) * 3,
        "air_density": 1.2,
        "wind": (3.0, 0.0, 0.0),
        "ground_contact": np.zeros(ticks, bool),
    }
    tables = {"vehicle": {"model": model}, **({"airframe": AIRFRAME} if scene is None else scene)}
    result = synthetic_flights.flight(ticks, RATE, scene=tables, ground_truth=truth, **topics)
    result.digest = "0" * 32
    return result


class Recorder:
    """Fake viser scene that stores the added nodes."""

    def __init__(self):
        self.nodes = {}

    def __getattr__(self, kind):
        def add(name, *arguments, **options):
            handle = type("Node", (), {"name": name, "kind": kind, "arguments": arguments, **options})()
            self.nodes[name if isinstance(name, str) else kind] = handle
            return handle

        return add


def fleet():
    """Return two vehicles, the second 4 m north of the first."""
    first = flight()
    truth = {name: first.truth[name] for name in first.truth.fields}
    truth["pose.position"] = first.truth.position + np.array([0.0, 4.0, 0.0])
    second = FlightData({"ground_truth": TopicView(np.arange(TICKS) * 10**7, truth)}, copy.copy(first.origin))
    second.vehicle = "second"
    first.others = (second,)
    first.fleet = {"second": second.truth, first.vehicle: first.truth}
    return first


def volume(solid):
    """Return the volume inside the faces of a solid."""
    a, b, c = (solid.vertices[solid.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)

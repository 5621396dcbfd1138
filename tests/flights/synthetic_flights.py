"""Synthetic flights from columns, with known metrics."""

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_provenance import Origin
from lapwing.flights.topic_view import TopicView

LEVEL = (0.0, 0.0, 0.0, 1.0)  # x, y, z, w


def config(ticks, rate=100, **resolved):
    return RunConfig("made_up", "", 1, ticks - 1, rate, 10**9 // rate, "gauss_seidel", "drone1", {}, {}, resolved)


def flight(ticks, rate=100, failure="", diverged=False, scene=None, **topics):
    """Return a flight of a number of ticks, from columns of topics by dotted name; single values are repeated."""
    views = {}
    for name, columns in topics.items():
        rows, defaults = {}, {"angular_velocity": (0.0, 0.0, 0.0)} if name == "ground_truth" else {}
        for field, value in (defaults | columns).items():
            column = np.asarray(value)
            rows[field] = column if column.shape[:1] == (ticks,) else np.broadcast_to(column, (ticks, *column.shape))
        views[name] = TopicView(np.arange(ticks) * (10**9 // rate), rows)
    return FlightData(views, Origin.of_config(config(ticks, rate, **(scene or {}))), failure, diverged)


def moved(x, power=100.0, failure="", rate=2, turned=LEVEL):
    """Return a flight along x [m] with a power [W], by default level."""
    x = np.asarray(x, float)
    truth = {
        "pose.position": np.column_stack([x, 0.0 * x, 0.0 * x]),
        "pose.orientation": turned,
        "motor_power": (power,),
    }
    return flight(len(x), rate, failure, ground_truth=truth)


def differences(a, b, topics):
    """Return topic and field of all columns that are not bit-for-bit identical in two flights."""
    result = []
    for topic in topics:
        one, other = a.topic(topic), b.topic(topic)
        result += [(topic, "times")] if not np.array_equal(one.times, other.times) else []
        result += [(topic, field) for field in set(one.fields) ^ set(other.fields)]
        result += [(topic, f) for f in one.fields if f in other.fields and _bits(one[f]) != _bits(other[f])]
    return result


def _bits(column):
    return column.tolist() if column.dtype == object else (column.dtype, column.shape, column.tobytes())

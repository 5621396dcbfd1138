"""A synthetic flight on a circle with known figures, and a parser of its report."""

import base64
import gzip
import json
import math
from html.parser import HTMLParser

import numpy as np
import synthetic_flights

from lapwing.cosim.config.provenance import attachments as attachments_of
from lapwing.cosim.log import LogWriter
from lapwing.flights.flight_data import FlightData
from lapwing.messages import (
    Actuators,
    Estimate,
    Point,
    Pose,
    Quaternion,
    Setpoint,
    Status,
    Vector3,
    VehicleState,
    header,
)
from lapwing.views.report import write

RATE, SECONDS = 50, 6.0


OFFSET = (0.1, -0.2, 0.05, 0.01, -0.02, 0.03)  # reference minus truth, so the errors are these numbers


THRUST, TORQUE = 2e-4, 8e-6  # over speed squared


ESTIMATE_ERROR = 0.02  # estimate minus truth of x [m]


SETUP = synthetic_flights.config(
    int(RATE * SECONDS) + 1,
    RATE,
    run={"title": "a circle <by> formula"},
    published={"source": "paper, Table 7", "rmse": {"x": 0.2373, "yaw": 0.0220}},
)


METADATA = {
    "scene": "circle",
    "seed": "7",
    "mode": "single-process",
    "solver_integrator": "rk4",
    "solver_step": "0.001",
}


def rotation(roll, pitch, yaw):
    """Return the quaternion of yaw, then pitch, then roll about rotated axes, from a textbook formula."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return Quaternion(
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def messages(std=0.05, rotors=4, reference=True, east=0.0):
    """Yield topic and message of each tick: a circle with oscillating angles, motors armed from 1 s on."""
    for tick in range(int(RATE * SECONDS) + 1):
        t = tick / RATE
        stamp = header(tick * 1_000_000_000 // RATE, "world")
        position = (math.cos(t), math.sin(t), 1.0 + 0.1 * t)
        angles = (0.1 * math.sin(t), 0.1 * math.cos(t), 0.2 * t)
        speed = (300.0 + 50.0 * math.sin(t),) * rotors
        pose = Pose(Point(position[0] + east, *position[1:]), rotation(*angles))
        truth = VehicleState(stamp, pose)._replace(
            rotor_speed=speed,
            motor_voltage=tuple(0.1 * w for w in speed),
            motor_current=tuple(0.03 * w for w in speed),
            motor_power=tuple(1e-5 * w**3 for w in speed),
            rotor_thrust=tuple(THRUST * w**2 for w in speed),
            rotor_torque=tuple(TORQUE * w**2 for w in speed),
            wind=Vector3(3.0, math.sin(t), 0.0),
            air_density=1.2,
            ground_contact=t >= SECONDS,
        )
        yield "ground_truth", truth
        requested = [value + offset for value, offset in zip(position + angles, OFFSET, strict=True)]
        if reference:
            phase = "climb" if t < 3.0 else "hover"
            yield "setpoint", Setpoint(stamp)._replace(position=Vector3(*requested[:3]), yaw=requested[5], phase=phase)
            yield (
                "actuators",
                Actuators(stamp)._replace(armed=t >= 1.0, attitude_reference=Vector3(requested[3], requested[4], 0.0)),
            )
        if tick % 5 == 0:
            estimated = pose._replace(position=Point(position[0] + ESTIMATE_ERROR, *position[1:]))
            wrong = ("gps", "sonar") if tick == 50 else ("gps",) if tick == 100 else ()
            spread = dict.fromkeys(("position_std", "velocity_std", "attitude_std"), Vector3(std, std, std))
            yield "estimate", Estimate(stamp, estimated)._replace(rejected_sources=wrong, **spread)
            yield "status", Status(stamp)._replace(landed=t >= SECONDS, finished=t >= SECONDS)


def record(path, entries, attachments=None):
    with LogWriter(path, METADATA, attachments_of(SETUP, {}) if attachments is None else attachments) as log:
        for topic, message in entries:
            instant = message.header.stamp
            time_ns = instant.sec * 1_000_000_000 + instant.nanosec
            log.write(f"/drone1/{topic}", type(message), message.encode(), time_ns)
            log.flush() if topic == "status" and time_ns % 1_000_000_000 == 0 else None
    return path


class Page(HTMLParser):
    """Parser of texts, plots and addresses of a page; unclosed elements are an error."""

    def __init__(self, path):
        super().__init__()
        self.plots, self.addresses, self.texts, self.tags, self.ids = {}, [], [], [], []
        self._open = []
        self.feed(path.read_text(encoding="utf-8"))
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        result = dict(attrs)
        if tag == "section":
            self.ids.append(result["id"])
        self.addresses += [v for k, v in attrs if k in ("src", "href", "srcset", "data", "action")]
        if tag not in ("meta", "link", "input"):
            self._open.append("plot" if result.get("type") == "application/gzip" else tag)

    def handle_endtag(self, tag):
        assert self._open.pop() in (tag, "plot")

    def handle_data(self, data):
        if self._open[-1:] == ["plot"]:
            self.plots[self.ids[-1]] = json.loads(gzip.decompress(base64.b64decode(data, validate=True)))
        elif data.strip() and self._open[-1] not in ("script", "style"):
            self.texts.append(data.strip())

    def after(self, text):
        """Return the text after `text`, such as a table's value after its name."""
        return self.texts[self.texts.index(text) + 1]


def report(log):
    """Write the report of a log in its folder and return its path."""
    return write(FlightData.read(log), log.with_suffix(".html"))


def values(array):
    """Return the numbers of an array as page.js decodes them."""
    if isinstance(array, list):
        return np.array(array, float)
    if "bdata" in array:
        return np.frombuffer(base64.b64decode(array["bdata"], validate=True), "<f4")
    planes = np.frombuffer(base64.b64decode(array["steps"], validate=True), np.uint8).reshape(2, -1)
    changes = planes[0] + 256 * planes[1].astype(int)
    steps = np.cumsum(changes).astype(np.int16).astype(float)
    return np.where(steps == -32768, np.nan, array["low"] + (steps + 32767) * array["step"])

"""Figures of the report against the formulas of the flight."""

import math

import numpy as np
import pytest
from circle_report import ESTIMATE_ERROR, OFFSET, RATE, SECONDS, THRUST, TORQUE, record
from scipy.spatial.transform import Rotation

from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_topics import AXES
from lapwing.flights.rotation_arrays import conjugate, from_xyzw, product, rotation_vector
from lapwing.messages import Estimate, Point, Pose, Quaternion, VehicleState, header
from lapwing.views.report.flight_phases import phases
from lapwing.views.report.plots import estimator, propulsion


def test_errors_are_offsets_that_were_flown(log, page):
    for index, (axis, offset) in enumerate(zip(AXES, OFFSET, strict=True)):
        unit, scale = ("m", 1.0) if index < 3 else ("°", 180.0 / math.pi)
        assert page.after(f"{axis} [{unit}]") == f"{scale * abs(offset):.4f}"
        assert FlightData.read(log).rmse[axis] == pytest.approx(abs(offset), rel=1e-9)
        assert FlightData.read(log).errors[axis] == pytest.approx(offset, rel=1e-9)  # also its sign
    assert page.after(page.after("x [m]")) == "0.2373"
    assert page.after(page.after("y [m]")) != "0.2700"  # no published value for y in this scene


def test_summary_equals_log(log, page):
    flight = FlightData.read(log)
    assert page.after("digest") == flight.digest
    assert page.after("duration") == "6.00 s"
    assert page.after("landed") == "yes"
    assert page.after("seed") == "7"
    assert page.after("solver") == "rk4, step 0.001 s"
    assert any("a circle <by> formula" in text for text in page.texts)  # escaped, not parsed as an element


def test_only_armed_samples_count(log):
    assert FlightData.read(log).armed.sum() == RATE * (SECONDS - 1.0) + 1
    assert all(len(e) == FlightData.read(log).armed.sum() for e in FlightData.read(log).errors.values())


def test_phases_follow_one_another(log):
    assert phases(FlightData.read(log)) == [("climb", 0.0, 3.0), ("hover", 3.0, pytest.approx(SECONDS))]


def test_coefficients_equal_those_of_propeller(log):
    flight = FlightData.read(log)
    speed = flight.truth.rotor_speed[:, 0]
    assert propulsion.coefficient(speed, flight.truth.rotor_thrust[:, 0], 2) == pytest.approx(THRUST)
    assert propulsion.coefficient(speed, flight.truth.rotor_torque[:, 0], 2) == pytest.approx(TORQUE)


def test_rotation_vectors_equal_those_of_scipy():
    a, b = (Rotation.random(100, random_state=seed).as_quat() for seed in (1, 2))
    b[:50] *= -1.0  # the same attitudes
    expected = (Rotation.from_quat(a).inv() * Rotation.from_quat(b)).as_rotvec()
    start, end = from_xyzw(a), from_xyzw(b)
    assert rotation_vector(product(conjugate(start), end)) == pytest.approx(expected, abs=1e-14)
    assert not rotation_vector(product(conjugate(start), start)).any()


def test_estimate_errors_and_rejections(log):
    error = estimator.errors(FlightData.read(log))
    expected = np.zeros(9)
    expected[0] = ESTIMATE_ERROR
    assert error == pytest.approx(np.broadcast_to(expected, error.shape), abs=1e-9)
    assert estimator.rejections(FlightData.read(log)) == "Measurements rejected: gps 2, sonar 1."


def test_attitude_error_is_in_body_frame(tmp_path):
    """Truth yawed by 90 degrees; an estimate with 0.1 rad more roll about body x has the error (0.1, 0, 0)."""
    c = math.cos(math.pi / 4)
    true, roll = Quaternion(x=0.0, y=0.0, z=c, w=c), (math.sin(0.05), math.cos(0.05))
    estimated = Quaternion(x=c * roll[0], y=c * roll[0], z=c * roll[1], w=c * roll[1])  # true * roll, by hand
    stamp = header(0, "world")
    both = [
        ("ground_truth", VehicleState(stamp, Pose(Point(), true))),
        ("estimate", Estimate(stamp, Pose(Point(), estimated))),
    ]
    later = [(topic, m._replace(header=header(10**9, "world"))) for topic, m in both]
    error = estimator.errors(FlightData.read(record(tmp_path / "yawed.mcap", both + later)))
    assert error[:, 6:] == pytest.approx(np.array([[0.1, 0.0, 0.0]] * 2), abs=1e-12)

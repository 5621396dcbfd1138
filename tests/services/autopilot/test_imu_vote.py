"""Redundant inertial measurement units: the vote, flights with a failed unit, and `lapwing run` with one."""

import subprocess
import sys

import numpy as np
import pytest
from flights import ENABLED, fly_by_sensors, inject, sent_texts

import lapwing
from lapwing.cosim.diagram.compiled_block import InputSample
from lapwing.services.autopilot import imu_vote
from lapwing.services.common.failure_types import GARBAGE, OFF, STUCK
from lapwing.services.common.ports import ImuReading

FAULTS = {
    "off": [{"kind": "dropout", "start": 20.0}],
    "stuck": [{"kind": "freeze", "start": 20.0}],
    "noise": [{"kind": "spikes", "start": 20.0, "size": 5.0, "probability": 1.0}],
}


def fly(count, faults=()):
    return lapwing.fly(
        "delivery_mission", overrides={"sensors.imu.instances": count, "sensors.imu.faults": list(faults)}
    )


def texts(flight):
    return [event.text for event in flight.events if event.text.startswith("IMU")]


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.long
def test_vehicle_with_three_units_lands_with_failed_first_unit(fault):
    flight = fly(3, FAULTS[fault])
    assert flight.landed
    assert flight.outcome.kind == "landed"
    assert texts(flight) == ["IMU 1 has failed, IMU 2 is in use"]
    (event,) = [event for event in flight.events if event.text.startswith("IMU")]
    assert 20.0 < event.time < 20.2


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.long
def test_vehicle_with_one_unit_does_not_land_with_failed_unit(fault):
    assert fly(1, FAULTS[fault]).outcome.kind == "crashed"


@pytest.mark.parametrize("fault", ["off", "stuck"])
@pytest.mark.long
def test_vehicle_with_two_units_lands_with_missing_or_stuck_unit(fault):
    assert fly(2, FAULTS[fault]).outcome.kind == "landed"


@pytest.mark.long
def test_redundant_units_have_independent_errors():
    single, several = fly(1), fly(3)
    assert texts(several) == []
    second, third = (several.topic(f"custom_sensor/imu{unit}")["values"][:500, :3].mean(axis=0) for unit in (2, 3))
    first = several.topic("imu").angular_velocity[:500].mean(axis=0)
    assert np.abs(first - second).max() > 1e-4
    assert np.abs(second - third).max() > 1e-4
    np.testing.assert_array_equal(single.topic("imu").angular_velocity, several.topic("imu").angular_velocity)
    np.testing.assert_array_equal(single.estimate.velocity, several.estimate.velocity)


def fly_with_injections(script):
    return fly_by_sensors(10.0, script, ENABLED, "sensors.imu.instances=3")


@pytest.fixture(scope="module")
def sound_position():
    return last_position(fly_with_injections({}))


def last_position(flight):
    return flight.column("ground_truth", lambda m: (m.pose.position.x, m.pose.position.y, m.pose.position.z))[-1]


@pytest.mark.parametrize("kind", [OFF, STUCK, GARBAGE])
@pytest.mark.long
def test_injected_failure_of_one_instance_is_named_and_harmless(kind, sound_position):
    script = {7.0: [inject("gyro", kind, 1), inject("accelerometer", kind, 4, id=8)]}
    flight = fly_with_injections(script)
    assert "inject failure: accelerometer 4 does not exist; expected 1 to 3, 0 for all" in sent_texts(flight)
    assert "IMU 1 has failed, IMU 2 is in use" in sent_texts(flight)
    assert last_position(flight) == pytest.approx(sound_position, abs=0.1)


@pytest.mark.long
def test_run_command_names_failed_unit(tmp_path):
    sets = ["sensors.imu.instances=3", 'sensors.imu.faults=[{kind="freeze",start=4.0}]', "run.duration=6.0"]
    command = [sys.executable, "-m", "lapwing", "run", "delivery_mission", "--log", str(tmp_path / "log.mcap")]
    done = subprocess.run(
        [*command, *(word for key in sets for word in ("--set", key))], capture_output=True, text=True, cwd=tmp_path
    )
    assert "IMU 1 has failed, IMU 2 is in use" in " ".join(done.stdout.split()), done.stdout + done.stderr


def reading(rate, valid=True):
    return ImuReading((rate, 0.0, 0.0), (rate, 0.0, 9.81), 1e-6, 1e-4, valid)


def vote(rows):
    """Return the selection after each row of readings."""
    step, state, result = imu_vote.step, imu_vote.VoteState(), []
    for tick, row in enumerate(rows):
        inputs = tuple(InputSample(True, r) for r in row)
        state, (_, selection), _ = step(imu_vote.Vote(12), state, tick, inputs)
        result.append(selection)
    return result


def varying_reading(k):
    return 1e-3 * np.sin(float(k))


def test_deviating_imu_fails_after_ten_readings():
    rows = [
        [reading(varying_reading(k) + 0.2), reading(varying_reading(k + 1)), reading(varying_reading(k + 2))]
        for k in range(20)
    ]
    result = vote(rows)
    assert {selection.unit for selection in result} == {2}
    assert [selection.switched for selection in result[:2]] == [True, False]
    assert [selection.failed for selection in result] == [0] * 9 + [1] * 11


def test_unit_in_use_stays_after_repair_of_first_unit():
    rows = [
        [
            reading(varying_reading(k), valid=not 5 <= k < 20),
            reading(varying_reading(k + 1)),
            reading(varying_reading(k + 2)),
        ]
        for k in range(300)
    ]
    result = vote(rows)
    assert [s.unit for s in result] == [1] * 5 + [2] * 295
    assert (result[-1].failed, result[100].failed) == (0, 1)

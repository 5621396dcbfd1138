"""Motor voltages set by an operator instead of the controller."""

import numpy as np
import pytest
from flights import ACCEPTED, OPERATED, RATE, REJECTED, UP, command, fly, results, scripted, sent_texts

from lapwing.cosim.log import LogReader
from lapwing.runs.resimulate import resimulate
from lapwing.runs.single_process_run import fly_single
from lapwing.services.scene_resolver import load, resolve
from tests.cosim import memory_log

EVERY_TICK = f"rates.commands={RATE}"
START = [command("offboard"), command("arm")]


def motors(*volts):
    return command("offboard_motors", *volts)


def test_external_voltages_reproduce_controlled_flight():
    flight = fly(12, {}, operated=False)
    volts = flight.column("actuators", lambda m: tuple(m.motor_voltage))
    values = {k: [motors(*v)] for k, v in enumerate(volts)}
    values[0] += START
    scene = load("hover", [*OPERATED, EVERY_TICK, "run.duration=12"])
    again = memory_log.fly(scene, lambda tick: values.get(tick, ()))
    assert volts.max() > 5.0
    count = len(volts)
    for name in ("ground_truth", "actuators"):
        one, other = (f.payloads(name)[:count] for f in (flight, again))
        assert len(one) == len(other) == count
        if name == "ground_truth":
            assert one == other
    assert np.array_equal(again.column("actuators", lambda m: tuple(m.motor_voltage))[:count], volts)
    thrust = [f.column("actuators", lambda m: tuple(m.thrust))[:count] for f in (flight, again)]
    assert thrust[1] == pytest.approx(thrust[0], rel=1e-9, abs=1e-9)


def test_direct_voltages_are_held_limited_and_time_out(tmp_path):
    script = UP | {3.0: [motors(7.0, 8.0, -1.0, 1e6), command("offboard")], 3.1: [command("hold")]}
    log = tmp_path / "direct.mcap"
    config = resolve(load("hover", [*OPERATED, "run.duration=8"]))
    fly_single(config, log, operator=scripted(script))
    with LogReader(log) as read:
        times, actuators = read.history("/drone1/actuators")
        _, truth = read.history("/drone1/ground_truth")
        digest = read.metadata["digest"]
    direct = (times >= 3_000_000_000) & (times < 3_100_000_000)
    highest = config.services["autopilot"].parameters.airframe.voltage_max
    assert np.array_equal(np.unique(actuators["motor_voltage"][direct], axis=0), [[7.0, 8.0, 0.0, highest]])
    assert not np.array_equal(actuators["motor_voltage"][times == 3_100_000_000][0], [7.0, 8.0, 0.0, highest])
    assert np.ptp(truth["angular_velocity"][direct], axis=0).max() > 0.5  # the voltages disturbed the vehicle
    assert np.abs(truth["velocity"][-1]).max() < 0.1  # at rest again
    assert resimulate(log) == (digest, digest)


def test_missing_voltages_trigger_failsafe():
    flight = fly(8, UP | {(3.0, 3.5): [motors(*[9.0] * 4)], 3.2: [command("offboard")]})
    assert "the offboard setpoints are lost: hold" in sent_texts(flight)


def test_vehicle_at_rest_with_motors_off_has_landed():
    script = {0.0: [motors(*[3.0] * 4), *START], 0.5: [motors(*[0.0] * 4)], (0.6, 2.4): [motors(*[0.0] * 4)]}
    flight = fly(3, script | {2.5: [command("disarm", id=9)]})
    assert results(flight)[9] == ACCEPTED


@pytest.mark.parametrize("volts", [(5.0,), (5.0,) * 6, (5.0, 5.0, 5.0, float("nan"))])
def test_invalid_voltages_are_rejected(volts):
    flight = fly(1, {0.1: [motors(*volts)], 0.2: [command("offboard", id=3)]})
    assert results(flight)[3] == REJECTED
    assert any("the last was rejected: expected 4 voltages, got [5.0" in text for text in sent_texts(flight))


@pytest.mark.long
def test_hexacopter_accepts_six_voltages():
    sets = [*OPERATED, "run.duration=1", "autopilot.estimator=ground_truth"]
    script = {0.0: [motors(*range(1, 7)), *START], (0.1, 1.0): [motors(*range(1, 7))]}
    flight = memory_log.fly(load("hexacopter", sets), scripted(script))
    last = flight.column("actuators", lambda m: tuple(m.motor_voltage))[-1]
    assert last == pytest.approx([1, 2, 3, 4, 5, 6])

"""Due ticks of samples, in Python and compiled, and the execution order of services."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lapwing.cosim.diagram.tick_schedule import LATCHED, InputPort, due, execution_order
from lapwing.cosim.run_errors import LockStepError
from lapwing.services.scene_resolver import load, resolve

SCENES = sorted((Path(__file__).parents[3] / "lapwing/scenes").glob("*.toml"))


def stamps(period, stop):
    """Return the ticks before `stop` with a sample of a producer."""
    return range(0, stop, max(1, period))


@given(st.integers(0, 5000), st.integers(0, 60), st.integers(0, 60))
def test_sample_is_due_after_its_delay(tick, period, delay):
    expected = tick - delay if tick - delay in stamps(period, tick + 1) else -1
    assert due.py_func(tick, period, delay) == expected


def test_compiled_and_python_rule_agree():
    random = np.random.default_rng(3)
    for tick, period, delay in random.integers(0, 200, (500, 3)).tolist():
        for p in (period, LATCHED, 1):
            assert due(tick, p, delay) == due.py_func(tick, p, delay)


@pytest.mark.parametrize(
    ("tick", "period", "delay", "stamp"),
    [
        (0, 1, 0, 0),
        (0, 1, 1, -1),  # no sample before the first tick
        (1, 1, 1, 0),
        (10, 5, 0, 10),
        (11, 5, 0, -1),
        (11, 5, 1, 10),  # one tick of delay
        (3, 5, 4, -1),
        (7, LATCHED, 0, 7),
        (7, LATCHED, 3, 4),
    ],
)
def test_due_stamp_of_examples(tick, period, delay, stamp):
    assert due.py_func(tick, period, delay) == stamp


def order(needs, gives):
    return execution_order({name: [InputPort(*i) for i in inputs] for name, inputs in needs.items()}, gives)


GIVES = {"plant": ["truth"], "sensors": ["imu"], "autopilot": ["actuators"]}


def test_service_steps_after_producers_of_undelayed_inputs():
    loop = {"autopilot": [("imu",)], "sensors": [("truth",)], "plant": [("actuators", 1)]}
    assert order(loop, GIVES) == ["plant", "sensors", "autopilot"]
    beside = loop | {"formation": [("truth",)]}
    assert order(beside, GIVES | {"formation": []}) == ["plant", "formation", "sensors", "autopilot"]


def test_execution_order_is_independent_of_naming_order():
    loop = {"autopilot": [("imu",)], "sensors": [("truth",)], "plant": [("actuators", 1)]}
    assert order(dict(reversed(loop.items())), dict(reversed(GIVES.items()))) == order(loop, GIVES)


def test_own_output_as_input_is_no_loop():
    assert order({"plant": [("truth",)]}, {"plant": ["truth"]}) == ["plant"]


def test_algebraic_loop_is_named():
    loop = {"autopilot": [("imu",)], "sensors": [("truth",)], "plant": [("actuators",)], "clock": []}
    message = r"^algebraic loop: autopilot, plant, sensors; give one input a delay of at least 1 tick$"
    with pytest.raises(LockStepError, match=message):
        order(loop, GIVES | {"clock": ["time"]})


def test_input_without_producer_is_named_with_consumer():
    with pytest.raises(LockStepError, match=r"^sensors needs wind, which no service of this scene publishes$"):
        order({"sensors": [("wind", 1)]}, {"sensors": ["imu"]})


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.stem)
@pytest.mark.parametrize("coupling", ["gauss_seidel", "jacobi"])
def test_every_scene_has_execution_order(path, coupling):
    config = resolve(load(path, [f"communication.coupling={coupling}"]))
    assert sorted(config.order) == sorted(config.services)
    place = {name: i for i, name in enumerate(config.order)}
    for name, service in config.services.items():
        for needed in service.inputs:
            assert needed.delay > 0 or place[config.producers[needed.port]] < place[name]

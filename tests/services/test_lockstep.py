"""Who comes after whom within a tick, and which message is due when."""

import pytest

from messages.topics import ACTUATORS, ESTIMATE, IMU, OPERATOR, SETPOINT, STATUS, TRUTH
from services.lockstep import Input, LockStepError, due, execution_order, published


class Fake:
    def __init__(self, inputs=(), outputs=()):
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)


def loop(delay):
    return {
        "autopilot": Fake([Input(IMU), Input(SETPOINT)], [ACTUATORS]),
        "plant": Fake([Input(ACTUATORS, delay)], [TRUTH]),
        "sensors": Fake([Input(TRUTH)], [IMU]),
        "trajectory": Fake([], [SETPOINT]),
    }


def test_everybody_comes_after_those_whose_undelayed_messages_it_needs():
    assert execution_order(loop(1)) == ["plant", "trajectory", "sensors", "autopilot"]


def test_the_order_does_not_depend_on_the_order_of_the_table():
    turned = dict(reversed(loop(1).items()))
    assert execution_order(turned) == execution_order(loop(1))


def test_a_loop_without_delay_is_refused_and_names_its_members():
    with pytest.raises(LockStepError, match=r"loop without delay: autopilot, plant, sensors$"):
        execution_order(loop(0))


def test_an_input_that_nobody_gives_is_refused():
    services = loop(1) | {"viewer": Fake([Input(ESTIMATE)])}
    with pytest.raises(LockStepError, match=r"viewer needs {vehicle}/estimate, which no service of this scene gives"):
        execution_order(services)


def test_a_delayed_input_needs_a_producer_too():
    with pytest.raises(LockStepError, match="plant needs"):
        execution_order({"plant": Fake([Input(STATUS, 1)], [TRUTH])})


def test_own_messages_do_not_hold_a_service_up():
    assert execution_order({"plant": Fake([Input(TRUTH)], [TRUTH])}) == ["plant"]


@pytest.mark.parametrize(
    ("period", "delay", "ticks"), [(1, 0, [0, 1, 2, 3, 4, 5]), (2, 0, [0, 2, 4]), (2, 1, [1, 3, 5])]
)
def test_due(period, delay, ticks):
    assert [tick for tick in range(6) if due(tick, period, delay)] == ticks


def test_nobody_waits_for_what_comes_from_outside_but_it_belongs_to_the_run():
    services = {"autopilot": Fake([Input(OPERATOR, external=True)], [ACTUATORS])}
    assert execution_order(services) == ["autopilot"]
    assert published(services.values()) == {OPERATOR, ACTUATORS}

"""A scene flown in this process without a log: what a study looks at many times over."""

from typing import Any, NamedTuple

import numpy as np

from messages.topics import TRUTH, Topic
from services.lockstep import LockStepError
from services.scene import Scene
from services.sections import Exchange, Vehicle
from services.single import run_single
from services.table import lockstep_services


class Messages:
    """Takes the place of a log: keeps the messages of the topics that are wanted."""

    def __init__(self, scene: Scene, wanted: tuple[Topic, ...]):
        self._kept: dict[str, list[Any]] = {topic.key(scene[Vehicle].name): [] for topic in wanted}
        self.of = {topic: self._kept[topic.key(scene[Vehicle].name)] for topic in wanted}

    def write(self, topic: str, message: Any, payload: bytes, time_ns: int, deterministic: bool = True) -> None:
        """Keep what is wanted, decoded."""
        if topic in self._kept:
            self._kept[topic].append(message.decode(payload))


class Trace(NamedTuple):
    """A flight tick by tick; `failure` says why it ended early, "" if it did not."""

    interval: float  # [s] between two rows
    position_world: np.ndarray  # [m] shape (n, 3)
    power: np.ndarray  # [W] electrical, of all motors, shape (n,)
    failure: str = ""

    @property
    def energy(self) -> float:
        """Electrical energy taken [J]."""
        return float(self.power.sum() * self.interval)


def fly(scene: Scene) -> Trace:
    """Fly `scene` to its end, or until its numbers are not finite."""
    messages, failure = Messages(scene, (TRUTH,)), ""
    try:
        run_single(scene, lockstep_services(scene), messages, None, lambda *_: False)
    except (LockStepError, ValueError) as error:
        failure = str(error)
    truth = messages.of[TRUTH]
    position = np.array([m.pose.position for m in truth]).reshape(-1, 3)
    return Trace(scene[Exchange].interval, position, np.array([sum(m.motor_power) for m in truth]), failure)

"""A recorded flight as columns of numbers."""

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from messages import message_class, stamp_ns
from services.log import LogReader
from services.scene import recorded_data
from studies import tracking

AXES = tuple(tracking.AXES)


class Flown:
    """A log read into memory: messages by topic, decoded when first asked for, and the flight's figures of merit."""

    def __init__(self, path: Path, vehicle: str | None = None):
        """Read a log of one vehicle; `vehicle` is its name, by default that of the first topic of the form /NAME/truth.

        Raises:
            ValueError: no such file, no MCAP log, or no flight in it.
        """
        self.path = Path(path)
        self._payloads: dict[str, tuple[str, list[int], list[bytes]]] = {}  # by topic: type, times [ns], payloads
        self._decoded: dict[str, list[Any]] = {}
        with LogReader(self.path) as log:
            self.metadata = dict(log.metadata)
            self.attachments = dict(log.attachments)
            for topic, type_name, time_ns, payload in log.messages():
                _, times, payloads = self._payloads.setdefault(topic, (type_name, [], []))
                times.append(time_ns)
                payloads.append(payload)
        named = vehicle or next((t.split("/")[1] for t in self._payloads if t.endswith("/truth")), None)
        if named is None or f"/{named}/truth" not in self._payloads:
            raise ValueError(f"{path}: no flight in this log (no topic /{named or 'NAME'}/truth)")
        self.vehicle = named

    def has(self, topic: str) -> bool:
        """Whether the vehicle's topic, for example "setpoint", is in the log."""
        return f"/{self.vehicle}/{topic}" in self._payloads

    def times(self, topic: str) -> np.ndarray:
        """Simulation times of a vehicle's topic [s], shape (n,)."""
        return np.array(self._payloads[f"/{self.vehicle}/{topic}"][1]) * 1e-9

    def column(self, topic: str, value: Callable[[Any], Any]) -> np.ndarray:
        """`value(message)` for each message of a vehicle's topic, shape (n,) or (n, k)."""
        return np.array([value(message) for message in self._messages(topic)])

    @property
    def digest(self) -> str:
        """Digest over the deterministic messages, as the log states it."""
        return self.metadata.get("digest", "")

    @cached_property
    def scene(self) -> dict[str, Any]:
        """The tables of the scene that the log carries; empty if it carries none.

        Raises:
            ValueError: they are not valid TOML.
        """
        try:
            return recorded_data(self.attachments.get("scene.toml", b"").decode("utf-8"))
        except ValueError as fault:
            raise ValueError(f"{self.path}: its attachment scene.toml is not valid TOML: {fault}") from None

    @cached_property
    def attitude(self) -> np.ndarray:
        """True roll, pitch, yaw [rad] at the times of "truth", shape (n, 3); yaw without jumps."""
        return tracking.roll_pitch_yaw(self.column("truth", lambda m: m.pose.orientation))

    @cached_property
    def reference(self) -> np.ndarray:
        """Reference x, y, z [m], roll, pitch, yaw [rad] at the first n times of "truth", shape (n, 6).

        The references of x, y, z and yaw are the setpoints, those of roll and pitch what the inner loops follow.
        The run may have ended between two topics: n is the count of the shortest. Without a reference it is 0.
        """
        if not (self.has("setpoint") and self.has("actuators")):
            return np.empty((0, len(AXES)))
        n = min(len(self.times(topic)) for topic in ("truth", "setpoint", "actuators"))
        position = self.column("setpoint", lambda m: m.position)[:n]
        roll_pitch = self.column("actuators", lambda m: (m.attitude_reference.x, m.attitude_reference.y))[:n]
        return np.column_stack([position, roll_pitch, self.column("setpoint", lambda m: m.yaw)[:n]])

    @cached_property
    def armed(self) -> np.ndarray:
        """Whether the motors are armed, at the times of `reference`, shape (n,) of bool."""
        n = len(self.reference)
        return self.column("actuators", lambda m: m.armed)[:n] if n else np.empty(0, dtype=bool)

    @cached_property
    def errors(self) -> dict[str, np.ndarray]:
        """Reference minus truth of each axis [m], [rad] while the motors are armed; empty without a reference."""
        n = len(self.reference)
        if n == 0:
            return {}
        position = self.column("truth", lambda m: m.pose.position)[:n]
        return dict(zip(AXES, tracking.errors(self.reference, position, self.attitude[:n], self.armed).T, strict=True))

    def rmse(self) -> dict[str, float]:
        """Root-mean-square error of each axis [m], [rad]."""
        return tracking.rmse(np.column_stack(list(self.errors.values()))) if self.errors else {}

    @property
    def landed(self) -> bool:
        """Whether the mission has ended on the ground with the motors off."""
        if not self.has("status"):
            return False
        last = self._messages("status")[-1]
        return bool(last.finished and last.landed)

    def stamps(self, topic: str) -> np.ndarray:
        """Header stamps [s] of a vehicle's topic, shape (n,): when what it says was true."""
        return self.column(topic, lambda m: stamp_ns(m.header)) * 1e-9

    def _messages(self, topic: str) -> list[Any]:
        """The decoded messages of a vehicle's topic."""
        if topic not in self._decoded:
            type_name, _, payloads = self._payloads[f"/{self.vehicle}/{topic}"]
            decode = message_class(type_name).decode
            self._decoded[topic] = [decode(payload) for payload in payloads]
        return self._decoded[topic]

"""Messages of one topic of a flight as arrays over time."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from lapwing.dynamics.config_error import ConfigError
from lapwing.flights import tracking
from lapwing.messages.types import DEFINITIONS

OF_POSE = {"position": "position", "orientation": "orientation", "attitude": "orientation"}  # source of each attribute


class TopicView:
    """View of the n messages of a topic: every field is an attribute, an array whose first axis is time.

    `truth.velocity` has shape (n, 3), `actuators.motor_voltage` (n, 4), `setpoint.yaw` (n,), `setpoint.phase` (n,) of
    str. `view["pose.position.x"]` is any field by its dotted name; an unknown one raises a ValueError, or as an
    attribute an AttributeError, of one line that names the nearest. Where the message has a pose, or one for each of k
    bodies, `position` [m] and `orientation` (x, y, z, w) are those of the pose, shape (n, 3) or (n, k, 3).
    """

    def __init__(self, times_ns: np.ndarray, columns: Mapping[str, Any]):
        """Create from simulation times [ns], int64, shape (n,), and columns by dotted field name."""
        self._times_ns, self._columns = times_ns, columns
        self._texts: dict[str, np.ndarray] = {}  # cache of text fields, which are slow to decode

    def payloads(self) -> Iterator[tuple[int, bytes]]:
        """Yield time [ns] and CDR of each message."""
        return zip(self._times_ns.tolist(), self._columns.payloads(), strict=True)  # type: ignore[attr-defined]

    @cached_property
    def times(self) -> np.ndarray:
        """Simulation times [s], shape (n,)."""
        return self._times_ns * 1e-9

    @cached_property
    def stamps(self) -> np.ndarray:
        """Header stamps [s], shape (n,): times at which the content of the messages is valid."""
        seconds, rest = self["header.stamp.sec"].astype(np.int64), self["header.stamp.nanosec"]
        return (seconds * 1_000_000_000 + rest) * 1e-9

    @property
    def position(self) -> np.ndarray:
        """Field `position`, or position of the pose [m], world, shape (n, 3)."""
        return self._of_pose("position", slice(0, 3))

    @property
    def orientation(self) -> np.ndarray:
        """Field `orientation`, or orientation of the pose: unit quaternions x, y, z, w, shape (n, 4)."""
        return self._of_pose("orientation", slice(3, 7))

    @cached_property
    def attitude(self) -> np.ndarray:
        """Roll, pitch, yaw of the pose [rad], shape (n, 3); yaw without jumps."""
        return tracking.roll_pitch_yaw(self.orientation)

    @cached_property
    def tilt_cosine(self) -> np.ndarray:
        """Cosine of the pose's tilt from the vertical, shape (n,); 1 where the attitude is not recorded."""
        try:
            x, y = self.orientation[:, 0], self.orientation[:, 1]
        except AttributeError:
            return np.ones(len(self.times))
        return 1.0 - 2.0 * (x * x + y * y)

    @property
    def fields(self) -> list[str]:
        """Dotted names of the fields that all messages have."""
        return list(self._columns)

    def flat(self) -> dict[str, np.ndarray]:
        """Return every number and text as a column (n,): "pose.position.x", "rotor_speed.0", "phase"."""
        result: dict[str, np.ndarray] = {}
        for name in self._columns:
            column = self[name]
            if column.ndim == 1:
                result[name] = column
            elif f"{name}.0" not in self._columns and not any(n.startswith(f"{name}.") for n in self._columns):
                result |= {f"{name}.{k}": column[:, k] for k in range(column.shape[1])}
        return result

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a field by its dotted name, or an attribute; str, or tuples of str, as objects.

        Raises:
            ValueError: there is no such field, or not all messages have it.
        """
        if name in self._texts:
            return self._texts[name]
        try:
            column = self._columns[name]
        except KeyError:
            if name in self._derived:
                return getattr(self, name)
            raise ValueError(self._unknown(name)) from None
        if isinstance(column, np.ndarray):
            return column
        if any(isinstance(value, tuple) for value in column):
            result = np.empty(len(column), object)
            result[:] = column
        else:
            result = np.array(column)
        self._texts[name] = result
        return result

    def __getattr__(self, name: str) -> np.ndarray:
        if name.startswith("_"):
            raise AttributeError(name)
        if name not in self._columns:
            raise AttributeError(self._unknown(name))
        return self[name]

    def __dir__(self) -> list[str]:
        own = set(super().__dir__()) - OF_POSE.keys() | self._derived
        return [*own, *(name for name in self._columns if "." not in name)]

    def __repr__(self) -> str:
        """Return the number of the messages and their definition, whose comments state frames and units."""
        if message := getattr(self._columns, "message", None):
            return f"{len(self)} {message.type_name}\n{DEFINITIONS[message.type_name].text.strip()}"
        return f"{len(self)} messages: {', '.join(self.fields)}"

    def __len__(self) -> int:
        return len(self._times_ns)

    @property
    def _derived(self) -> set[str]:
        """Attributes that are read like fields."""
        return {"times", *(name for name, source in OF_POSE.items() if self._pose_field(source))}

    def _pose_field(self, name: str) -> str:
        """Return the field that has the position or orientation, "" if there is none."""
        return next((field for field in (name, f"pose.{name}", "pose") if field in self._columns), "")

    def _of_pose(self, name: str, part: slice) -> np.ndarray:
        field = self._pose_field(name)
        if not field:
            raise AttributeError(name)
        return self[field][..., part] if field == "pose" else self[field]

    def _unknown(self, name: str) -> str:
        """Return the error text of an unknown field; it lists the fields beside it, or the attributes."""
        table = str(name).rpartition(".")[0]
        beside = [field for field in self._columns if table and field.rpartition(".")[0] == table]
        own = {field for field in self._columns if "." not in field} - {"pose"}  # its parts are named instead
        message = getattr(getattr(self._columns, "message", None), "type_name", "")
        return str(ConfigError.unknown(message, "field", name, beside or own | self._derived))

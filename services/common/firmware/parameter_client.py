"""Parameters of a firmware: each is read for its type, set, and confirmed, or only compared.

Source: MAVLink guide, "Parameter Protocol".
"""

import struct
from collections.abc import Collection, Mapping
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink

INTEGERS = {  # `struct` format by MAV_PARAM_TYPE
    mavlink.MAV_PARAM_TYPE_UINT8: "<Bxxx",
    mavlink.MAV_PARAM_TYPE_INT8: "<bxxx",
    mavlink.MAV_PARAM_TYPE_UINT16: "<Hxx",
    mavlink.MAV_PARAM_TYPE_INT16: "<hxx",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
}
RETRY = 1.0  # [s] until an unanswered request is sent again
TRIES = 5  # requests after which a parameter is unknown, or keeps its value
AT_ONCE = 5  # most requests in one poll


class ParameterClient:
    """Parameters that a firmware has not confirmed yet.

    Attributes:
        problems: a text for each parameter that the firmware did not take.
    """

    def __init__(self, values: Mapping[str, float], bytewise: bool, sets: bool, optional: Collection[str]):
        """Store parameters by name.

        Args:
            values: desired values.
            bytewise: integers keep their bytes in the float field.
            sets: True to set the parameters, False to compare them.
            optional: names of parameters that the firmware may lack.
        """
        self._optional, self._values = frozenset(optional), dict(values)
        self._bytewise, self._sets = bytewise, sets
        self._actual: dict[str, tuple[int, float]] = {}  # type and value
        self._requested: dict[str, tuple[int, float]] = {}  # number of requests, [s] of the next one
        self.problems: list[str] = []

    @property
    def done(self) -> bool:
        """True once no parameter has to be set that the firmware must have."""
        return not self._sets or self._values.keys() <= self._optional

    def requests(self, target: int, time: float) -> list[Any]:
        """Return the messages that are due at `time` [s]: each reads a parameter, or sets one whose type is known."""
        result: list[Any] = []
        for name in [name for name in self._values if time >= self._requested.get(name, (0, time))[1]][:AT_ONCE]:
            tries = self._requested.get(name, (0, 0.0))[0] + 1
            self._requested[name] = tries, time + RETRY
            kind = self._actual.get(name, (None,))[0]
            if tries > TRIES:
                self._give_up(name)
            elif kind is None or not self._sets:
                result.append(mavlink.MAVLink_param_request_read_message(target, 1, name.encode(), -1))
            else:
                value = self._values[name]
                if self._bytewise and kind in INTEGERS:
                    value = struct.unpack("<f", struct.pack(INTEGERS[kind], round(value)))[0]
                result.append(mavlink.MAVLink_param_set_message(target, 1, name.encode(), value, kind))
        return result

    def receive(self, message: Any) -> None:
        """Process a PARAM_VALUE."""
        name = message.param_id
        if name not in self._values:
            return
        value, desired = message.param_value, self._values[name]
        if self._bytewise and message.param_type in INTEGERS:
            value = struct.unpack(INTEGERS[message.param_type], struct.pack("<f", value))[0]
        self._actual[name] = message.param_type, value
        self._requested[name] = self._requested.get(name, (0, 0.0))[0], 0.0  # the next one at once
        if abs(value - desired) <= 1e-6 * max(1.0, abs(desired)):
            del self._values[name]
        elif not self._sets:
            self._give_up(name)

    def _give_up(self, name: str) -> None:
        desired = self._values.pop(name)
        reason = f"is {self._actual[name][1]:g} instead of {desired:g}" if name in self._actual else "is unknown to it"
        if name not in self._optional:
            self.problems.append(f"parameter {name} {reason}")

"""Setting of a firmware's parameters: each is read for its type, set, and confirmed.

Source: MAVLink guide, "Parameter Protocol".
"""

import struct
from collections.abc import Mapping
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


class ParameterClient:
    """Parameters that a firmware has not confirmed yet."""

    def __init__(self, values: Mapping[str, float], bytewise: bool):
        """Store parameters by name; `bytewise`: integers keep their bytes in the float field."""
        self._values, self._bytewise = dict(values), bytewise
        self._types: dict[str, int] = {}

    def request(self, target: int) -> Any | None:
        """Return the message that sets the next parameter, or first reads its type; None if all are confirmed."""
        if not self._values:
            return None
        name, value = next(iter(self._values.items()))
        kind = self._types.get(name)
        if kind is None:
            return mavlink.MAVLink_param_request_read_message(target, 1, name.encode(), -1)
        if self._bytewise and kind in INTEGERS:
            value = struct.unpack("<f", struct.pack(INTEGERS[kind], round(value)))[0]
        return mavlink.MAVLink_param_set_message(target, 1, name.encode(), value, kind)

    def receive(self, message: Any) -> bool:
        """Process a PARAM_VALUE. Return False if it is not one of these parameters."""
        name = message.param_id
        if name not in self._values:
            return False
        value, desired = message.param_value, self._values[name]
        if self._bytewise and message.param_type in INTEGERS:
            value = struct.unpack(INTEGERS[message.param_type], struct.pack("<f", value))[0]
        if abs(value - desired) <= 1e-6 * max(1.0, abs(desired)):
            del self._values[name]
        self._types[name] = message.param_type
        return True

"""MAVLink dialect of pymavlink, with messages of the common set that it leaves out as work in progress.

PX4 sends them and QGroundControl reads them. Their fields are those of common.xml; the checksum seed follows from them.
If pymavlink has a message, its definition is used.
"""

import struct
from functools import cache
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import all as mavlink

_FORMATS = {"char": "s", "int16_t": "h", "int32_t": "i", "uint8_t": "B", "uint16_t": "H", "uint32_t": "I"}
_FORMATS |= {"uint64_t": "Q", "float": "f"}


class _Field(NamedTuple):
    type: str
    name: str
    length: int  # length of an array; 0: a single value

    @property
    def format(self) -> str:
        """Format of the field for `struct`."""
        return f"{self.length or ''}{_FORMATS[self.type]}"


def _parse(text: str) -> _Field:
    """Return the field written as "uint8_t name" or "float name[4]"."""
    kind, _, name = text.partition(" ")
    name, _, length = name.partition("[")
    return _Field(kind, name, int(length.removesuffix("]") or 0))


class _Message(mavlink.MAVLink_message):
    """Message whose class is generated from its fields."""

    def __init__(self, *values: Any):
        super().__init__(self.id, self.msgname)
        self._fieldnames = self.fieldnames
        for name, value in zip(self.fieldnames, values, strict=True):
            setattr(self, name, value)

    def pack(self, mav: Any, force_mavlink1: bool = False) -> bytes:
        """Return the frame, numbered and signed by the codec `mav`."""
        flat: list[Any] = []
        for name in self.ordered_fieldnames:
            value = getattr(self, name)
            flat += value if isinstance(value, list | tuple) else [value]
        return self._pack(mav, self.crc_extra, self.unpacker.pack(*flat), force_mavlink1=force_mavlink1)


def _seed(name: str, ordered: list[_Field]) -> int:
    """Return CRC_EXTRA (MAVLink guide, "Serialization"): checksum of names and types in wire order."""
    crc = mavlink.x25crc(f"{name} ".encode())
    for field in ordered:
        crc.accumulate(f"{field.type} {field.name} ".encode())
        if field.length:
            crc.accumulate(bytes([field.length]))
    return (crc.crc & 0xFF) ^ (crc.crc >> 8)


def _define(number: int, name: str, *texts: str) -> None:
    """Add a message with these fields, in the order of common.xml, unless pymavlink has it."""
    fields = [_parse(text) for text in texts]
    ordered = sorted(fields, key=lambda f: -struct.calcsize(_FORMATS[f.type]))  # stable
    unpacker = struct.Struct("<" + "".join(f.format for f in ordered))
    mavlink.mavlink_map.setdefault(
        number,
        type(
            f"MAVLink_{name.lower()}_message",
            (_Message,),
            {
                "id": number,
                "msgname": name,
                "fieldnames": [f.name for f in fields],
                "ordered_fieldnames": [f.name for f in ordered],
                "fieldtypes": [f.type for f in fields],
                "native_format": bytearray("<" + "".join(_FORMATS[f.type] for f in ordered), "ascii"),
                "orders": [ordered.index(f) for f in fields],
                "lengths": [1 if f.type == "char" else f.length or 1 for f in ordered],
                "array_lengths": [f.length for f in ordered],
                "crc_extra": _seed(name, ordered),
                "unpacker": unpacker,
            },
        ),
    )


_define(
    290, "ESC_INFO", "uint8_t index", "uint64_t time_usec", "uint16_t counter", "uint8_t count",
    "uint8_t connection_type", "uint8_t info", "uint16_t failure_flags[4]", "uint32_t error_count[4]",
    "int16_t temperature[4]",
)  # fmt: skip
_define(
    291, "ESC_STATUS", "uint8_t index", "uint64_t time_usec", "int32_t rpm[4]", "float voltage[4]", "float current[4]",
)  # fmt: skip
_define(
    300, "PROTOCOL_VERSION", "uint16_t version", "uint16_t min_version", "uint16_t max_version",
    "uint8_t spec_version_hash[8]", "uint8_t library_version_hash[8]",
)  # fmt: skip
_define(397, "COMPONENT_METADATA", "uint32_t time_boot_ms", "uint32_t file_crc", "char uri[100]")
_define(
    410, "EVENT", "uint8_t destination_component", "uint8_t destination_system", "uint32_t id",
    "uint32_t event_time_boot_ms", "uint16_t sequence", "uint8_t log_levels", "uint8_t arguments[40]",
)  # fmt: skip
_define(411, "CURRENT_EVENT_SEQUENCE", "uint16_t sequence", "uint8_t flags")
_define(
    412, "REQUEST_EVENT", "uint8_t target_system", "uint8_t target_component", "uint16_t first_sequence",
    "uint16_t last_sequence",
)  # fmt: skip
_define(
    413, "RESPONSE_EVENT_ERROR", "uint8_t target_system", "uint8_t target_component", "uint16_t sequence",
    "uint16_t sequence_oldest_available", "uint8_t reason",
)  # fmt: skip


__all__ = ["id_of", "mavlink", "message_class"]


@cache
def _ids() -> dict[str, int]:
    return {message.msgname: number for number, message in mavlink.mavlink_map.items()}


def id_of(name: str) -> int | None:
    """Return the number of a message. Return None if the dialect lacks it."""
    return _ids().get(name)


def message_class(name: str) -> Any:
    """Return the class of a message that pymavlink may lack; arguments: the fields in the order of common.xml."""
    return mavlink.mavlink_map[_ids()[name]]

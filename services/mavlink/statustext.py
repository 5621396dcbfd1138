"""STATUSTEXT messages of texts for operators, in several pieces if they are long."""

from collections.abc import Iterator
from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink

TEXT_LENGTH = 50  # [bytes] of one STATUSTEXT


def statustext(severity: int, text: str, number: int = 1) -> Iterator[Any]:
    """Yield the messages of a text; `number` (not 0) identifies the pieces of a long one."""
    data = text.encode()
    text_id = number if len(data) > TEXT_LENGTH else 0
    for piece, start in enumerate(range(0, len(data), TEXT_LENGTH)):
        yield mavlink.MAVLink_statustext_message(severity, data[start : start + TEXT_LENGTH], text_id, piece)

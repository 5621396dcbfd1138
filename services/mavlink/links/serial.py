"""Serial line, for example of a telemetry radio. Its endpoint counts as another machine."""

import os
import re
import termios
import tty
from selectors import BaseSelector
from typing import ClassVar

from lapwing.services.mavlink.links.byte_stream import ByteStream
from lapwing.services.mavlink.links.link import Link
from lapwing.services.mavlink.links.receiver import Receiver


class Serial(Link):
    """A character device in raw mode."""

    SCHEME: ClassVar[str] = "serial"
    FORM: ClassVar[str] = "serial:DEVICE:BAUD"

    @classmethod
    def for_vehicle_index(cls, rest: str, i: int) -> str:
        """Return the rest of the URL. Raise ValueError for a second vehicle."""
        if i:
            raise ValueError(f"serial:{rest}: serves one vehicle; expected udpout, udpin or tcpin")
        return rest

    def __init__(self, rest: str, adapter: Receiver, selector: BaseSelector):
        super().__init__(rest, adapter, selector)
        path, _, baud = rest.rpartition(":")
        self._descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(self._descriptor)
            settings = termios.tcgetattr(self._descriptor)
            settings[4] = settings[5] = getattr(termios, f"B{baud}")
            termios.tcsetattr(self._descriptor, termios.TCSANOW, settings)
        except termios.error as error:
            os.close(self._descriptor)
            raise OSError(error.args[0], "is not a serial line") from None
        self._stream: ByteStream | None = ByteStream(
            self._descriptor, False, adapter, selector, self.may_read, self._on_end
        )

    @staticmethod
    def fits(rest: str) -> bool:
        """Return True for a device and a baud rate that the system supports."""
        match = re.fullmatch(r"/.+:(\d+)", rest, re.ASCII)
        return match is not None and hasattr(termios, f"B{match[1]}")

    def _on_end(self) -> None:
        self._stream = None
        os.close(self._descriptor)

    def close(self) -> None:
        """Close the device."""
        if self._stream:
            self._stream.end()
            self._on_end()

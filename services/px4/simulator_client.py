"""TCP client for a simulator with PX4's simulator interface: PX4's side of the link."""

import contextlib
import select
import socket
import time
from collections import deque

from lapwing.cosim.processes.patience import Patience
from lapwing.services.common.firmware.link import FirmwareError, LinkReport, Waits
from lapwing.services.px4.framing import FrameParser, Layout, frame
from lapwing.services.px4.messages import ARMED, DISTANCE_SENSOR, HEARTBEAT, HIL_ACTUATOR_CONTROLS, HIL_GPS, HIL_SENSOR
from lapwing.services.px4.messages import LOCK_STEP as LOCK_STEP_FLAG

WAIT = 0.2  # [s] of one wait
PIECE = 65536  # [bytes]
SYSTEM, COMPONENT = 1, 1  # ids of an autopilot
RECEIVED = (HIL_SENSOR, HIL_GPS, DISTANCE_SENSOR)
HELLO = (0, 2, 12, 0, 4, 3)  # HEARTBEAT: quadrotor, PX4, active, MAVLink 2
CUSTOM_MODE = 1
CONTROLS = 16

Message = tuple[int, tuple]  # id, values in wire order


class SimulatorClient:
    """Connection to one simulator."""

    def __init__(self, host: str, port: int):
        """Store the address; open nothing."""
        self.where = f"tcp {host}:{port}"
        self.report = LinkReport("PX4 simulator")
        self._address = (host, port)
        self._socket: socket.socket | None = None
        self._messages: deque[Message] = deque()
        self._parser, self._sequence = FrameParser(RECEIVED), 0
        self._answer: bytes = b""  # last answer, sent again on a repeated message

    def open(self, waits: Waits, timeout: float) -> None:
        """Connect within `timeout` [s].

        Raises:
            FirmwareError: nothing listens.
        """
        patience = Patience(timeout)
        while self._socket is None:
            waits(f"a simulator on {self.where}")
            try:
                self._socket = socket.create_connection(self._address, timeout=WAIT)
            except OSError:
                if patience.over:
                    message = f"simulator: no answer on {self.where} for {timeout:g} s"
                    raise FirmwareError(f"{message}; start it, or check --px4-sim") from None
                time.sleep(0.05)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)
        self._send(HEARTBEAT, HELLO)

    def receive(self, waits: Waits, timeout: float, at: str) -> list[Message] | None:
        """Return the messages up to the next HIL_SENSOR of the first IMU; None once the simulator has disconnected.

        The split depends only on the content of the stream, not on the arrival of its pieces.

        Raises:
            FirmwareError: none arrives within `timeout` [s]; `at` is the time for the message.
        """
        result: list[Message] = []
        start, patience = time.perf_counter(), None
        while True:
            while self._messages:
                result.append(self._messages.popleft())
                number, values = result[-1]
                if number == HIL_SENSOR.number and values[15] == 0:
                    self.report.waiting += time.perf_counter() - start
                    return result
            if not self._read():
                return None
            if not self._messages:
                waits("the simulator")
                patience = patience or Patience(timeout)
                if patience.over:
                    message = f"simulator: no HIL_SENSOR from {self.where} for {timeout:g} s {at}"
                    raise FirmwareError(f"{message}; check that it runs")

    def answer(self, time_us: int, controls: tuple[float, ...], armed: bool) -> None:
        """Send the motor controls (0 to 1) of a time, as PX4 in lock step does."""
        padded = (*controls, *(0.0,) * (CONTROLS - len(controls)))
        mode = CUSTOM_MODE | (ARMED if armed else 0)
        self._send(HIL_ACTUATOR_CONTROLS, (time_us, LOCK_STEP_FLAG, *padded, mode))

    def repeat(self) -> None:
        """Send the last answer again."""
        self._write(self._answer)

    def close(self) -> None:
        """Close the connection."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _read(self) -> bool:
        """Read the available bytes, after at most 0.2 s. Return False once the simulator has closed the connection."""
        if self._socket is None:
            return False
        if not self._poll.poll(1000.0 * WAIT):
            return True
        try:
            data = self._socket.recv(PIECE)
        except BlockingIOError:
            return True
        except OSError:
            data = b""
        if not data:
            self.close()
            return False
        self._messages.extend(self._parser.parse(data))
        self.report.rejected = self._parser.rejected
        return True

    def _send(self, layout: Layout, values: tuple) -> None:
        self._answer = frame(layout, self._sequence, values, SYSTEM, COMPONENT)
        self._sequence = (self._sequence + 1) & 0xFF
        self._write(self._answer)

    def _write(self, data: bytes) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):  # `receive` detects a lost connection
                self._socket.sendall(data)

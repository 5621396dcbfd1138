"""Scripted PX4: the other side of the simulator interface, with pymavlink as its codec.

It connects, requests ground truth and sends a heartbeat as PX4 does, ignores messages while it "starts", and then
answers every HIL_SENSOR of instance 0 with the outputs of that time.
"""

import math
import socket
import struct
import time
from contextlib import suppress

from pymavlink.dialects.v20 import all as mavlink

STARTING = 15  # messages before the first answer: 60 ms at 250 Hz


def instance(message):
    """Return the number of the sensor in a message, 0 for a kind without numbers (its `id` is that of the kind)."""
    return message.id if "id" in message.fieldnames else 0


class Px4Peer:
    """Scripted PX4."""

    def __init__(self, port, host="127.0.0.1", attempts=200):
        """Connect; repeat as PX4 does until the simulator listens."""
        for _ in range(attempts):
            try:
                self._socket = socket.create_connection((host, port), timeout=0.1)
                break
            except OSError:
                time.sleep(0.1)
        self._socket.settimeout(60.0)
        self.codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._waiting = []
        self.skipped = []  # messages of other kinds
        self.armed = False
        self.send(mavlink.MAVLink_command_long_message(0, 0, 511, 0, 115, 5000, 0, 0, 0, 0, 0))
        self.send(mavlink.MAVLink_heartbeat_message(0, 12, 0, 0, 0, 3))

    def send(self, message):
        """Send a message."""
        self.send_bytes(message.pack(self.codec))

    def send_bytes(self, data):
        """Send any bytes."""
        self._socket.sendall(data)

    def receive(self, kind="HIL_SENSOR"):
        """Return the next message of a kind and instance 0; None when the simulator has closed the connection."""
        while True:
            while self._waiting:
                message = self._waiting.pop(0)
                if message.get_type() == kind and instance(message) == 0:
                    return message
                self.skipped.append(message)
            data = b""
            with suppress(ConnectionResetError):
                data = self._socket.recv(65536)
            if not data:
                return None
            self._waiting = self.codec.parse_buffer(data) or []

    def start(self):
        """Receive as many messages as PX4 needs to start."""
        for _ in range(STARTING):
            message = self.receive()
        return message

    def answer(self, time_us, controls=(0.0,) * 4, flags=1):
        """Send the outputs of a time."""
        values = [*controls, *(0.0,) * (16 - len(controls))]
        mode = 129 if self.armed else 1
        self.send(mavlink.MAVLink_hil_actuator_controls_message(time_us, values, mode, flags))

    def run(self, steps, controls=lambda message: (0.0,) * 4):
        """Answer HIL_SENSOR messages; return them."""
        result = []
        for _ in range(steps):
            message = self.receive()
            if message is None:
                break
            result.append(message)
            self.answer(message.time_usec, controls(message))
        return result

    def close(self, resets=False):
        """Close the connection; True: by a reset, after which the system has forgotten its address."""
        if resets:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self._socket.close()


def finite(message):
    """Return True if all numbers of a message are finite."""
    return all(math.isfinite(v) for v in message.to_dict().values() if isinstance(v, float))

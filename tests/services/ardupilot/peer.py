"""Scripted ArduPilot: the other side of the JSON interface, written from its description.

It sends a servo packet, waits for the state, and sends the packet again if no state arrives. It reads the state by a
search for keys, as ArduPilot does: it cannot read a message that only a JSON parser understands.
"""

import re
import socket
import struct

RESEND = 1.0  # [s]
KEYS = {"timestamp": 1, "gyro": 3, "accel_body": 3, "position": 3, "quaternion": 4, "velocity": 3}
NUMBER = r"[-+0-9.eE]+"


def servo_packet(count, pwm=(1000,) * 16, magic=18458, rate=1200):
    """Return the bytes of a servo packet."""
    return struct.pack(f"<HHI{len(pwm)}H", magic, rate, count, *pwm)


def read_state(data):
    """Return the required fields by key, and voltage and current of the battery if it has them.

    Raises:
        ValueError: ArduPilot would not read the message.
    """
    text = data.decode()
    if not (text.startswith("\n") and text.endswith("\n")):
        raise ValueError("no line of its own")
    result = {}
    for key, count in KEYS.items():
        at = text.find(key)
        if at < 0:
            raise ValueError(f"no {key}")
        rest = text[at + len(key) + 2 :]
        pattern = NUMBER if count == 1 else rf"\[({NUMBER}(?:,\s*{NUMBER}){{{count - 1}}})"
        match = re.match(pattern, rest)
        if not match:
            raise ValueError(f"{key} is not read: {rest[:20]!r}")
        result[key] = [float(v) for v in match.group(match.lastindex or 0).split(",")]
    battery = re.search(rf'"battery":{{"voltage":({NUMBER}),"current":({NUMBER})}}', text)
    result["battery"] = [float(v) for v in battery.groups()] if battery else []
    return result


class ArduPilotPeer:
    """Scripted ArduPilot."""

    def __init__(self, port, host="127.0.0.1"):
        """Open a socket that sends to the simulator's port."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((host, 0))
        self._socket.settimeout(RESEND)
        self._address = (host, port)
        self.count, self.resent = 0, 0

    def send(self, data):
        """Send any datagram."""
        self._socket.sendto(data, self._address)

    def receive(self, timeout=RESEND):
        """Return the next state message, None if none arrives."""
        self._socket.settimeout(timeout)
        try:
            return self._socket.recv(65536)
        except TimeoutError:
            return None

    def exchange(self, pwm=(1000,) * 16, attempts=30, rate=1200):
        """Send the next frame until it is answered; return the state."""
        for _ in range(attempts):
            self.send(servo_packet(self.count, pwm, rate=rate))
            data = self.receive()
            if data is not None:
                self.count += 1
                return read_state(data)
            self.resent += 1
        raise TimeoutError("the simulator does not answer")

    def close(self):
        """Close the socket."""
        self._socket.close()

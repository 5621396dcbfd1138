"""A client of the Foxglove WebSocket protocol."""

import base64
import json
import os
import socket

CLOSE, PONG = 8, 10  # kinds of frames
PING = bytes([0x89, 0x80, *bytes(4)])
PATIENCE = 0.05  # [s] for a pong, which a server does not give that waits for the rest of a frame


class Client:
    """As small a client as will do (RFC 6455; no message of ours is fragmented)."""

    def __init__(self, port):
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=30.0)
        self._received = b""  # and not yet read
        key = base64.b64encode(os.urandom(16)).decode()
        lines = ["GET / HTTP/1.1", f"Host: 127.0.0.1:{port}", "Upgrade: websocket", "Connection: Upgrade"]
        lines += [f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Protocol: foxglove.sdk.v1"]
        self._socket.sendall("\r\n".join([*lines, "", ""]).encode())
        while b"\r\n\r\n" not in self._received:
            self._receive()
        answer, _, self._received = self._received.partition(b"\r\n\r\n")
        assert b" 101 " in answer, answer

    def next(self):
        """A text as JSON has it, or bytes; None at the end."""
        while True:
            try:
                kind, data = self._frame()
            except (EOFError, ConnectionResetError):
                return None
            if kind == CLOSE:
                return None
            if kind in (1, 2):
                return json.loads(data) if kind == 1 else data

    def say(self, **message):
        data = json.dumps(message).encode()
        assert len(data) < 65536
        self.send(bytes([0x81, 0xFE]) + len(data).to_bytes(2, "big") + bytes(4) + data)

    def send(self, data):
        """Bytes as they are."""
        self._socket.sendall(data)

    def answers(self):
        """Whether a ping is answered before the server closes, or waits for more."""
        self._socket.settimeout(PATIENCE)
        try:
            self.send(PING)
            while (kind := self._frame()[0]) != PONG:
                if kind == CLOSE:
                    return False
        except (EOFError, OSError):
            return False
        return True

    def close(self):
        self._socket.close()

    def subscribe(self, *topics):
        """All of these are advertised, and subscribed to by their place."""
        channels = {}
        while not set(topics) <= set(channels):
            message = self.next()
            if isinstance(message, dict) and message["op"] == "advertise":
                channels |= {channel["topic"]: channel for channel in message["channels"]}
        wanted = [{"id": k, "channelId": channels[topic]["id"]} for k, topic in enumerate(topics)]
        self.say(op="subscribe", subscriptions=wanted)
        return [channels[topic] for topic in topics]

    def _frame(self):
        """Its kind, and what it holds."""
        first, size = self._read(2)
        if size >= 126:
            size = int.from_bytes(self._read(2 if size == 126 else 8), "big")
        return first & 0x0F, self._read(size)

    def _read(self, size):
        while len(self._received) < size:
            self._receive()
        data, self._received = self._received[:size], self._received[size:]
        return data

    def _receive(self):
        part = self._socket.recv(65536)
        if not part:
            raise EOFError
        self._received += part


def patient(port, process):
    """A client of a process that may not listen yet."""
    while process.poll() is None:
        try:
            return Client(port)
        except ConnectionRefusedError:
            continue
    raise AssertionError("the replay has ended")

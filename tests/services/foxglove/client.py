"""A client of the Foxglove WebSocket protocol."""

import base64
import json
import os
import socket
from contextlib import suppress

CLOSE, PONG = 8, 10  # kinds of frames
PATIENCE = 0.05  # [s] wait for a pong; a server that waits for the rest of a frame does not send one


class Client:
    """Minimal WebSocket client (RFC 6455) without fragmented messages."""

    def __init__(self, port, timeout=30.0):
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=timeout)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # otherwise a frame waits 40 ms
        self._received = b""  # bytes not yet read
        self._pings = 0
        key = base64.b64encode(os.urandom(16)).decode()
        lines = ["GET / HTTP/1.1", f"Host: 127.0.0.1:{port}", "Upgrade: websocket", "Connection: Upgrade"]
        lines += [f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Protocol: foxglove.sdk.v1"]
        self._socket.sendall("\r\n".join([*lines, "", ""]).encode())
        while b"\r\n\r\n" not in self._received:
            self._receive()
        answer, _, self._received = self._received.partition(b"\r\n\r\n")
        assert b" 101 " in answer, answer

    def next(self):
        """Return the next message: decoded JSON or bytes; None at the end."""
        while True:
            try:
                kind, data = self._frame()
            except (EOFError, ConnectionResetError):
                return None
            if kind == CLOSE:
                return None
            if kind in (1, 2):
                return json.loads(data) if kind == 1 else data

    def send_json(self, **message):
        data = json.dumps(message).encode()
        assert len(data) < 65536
        self.send(bytes([0x81, 0xFE]) + len(data).to_bytes(2, "big") + bytes(4) + data)

    def send(self, data):
        """Send bytes unchanged."""
        self._socket.sendall(data)

    def answers(self):
        """Return True if the server answers a ping before it closes or waits."""
        self._socket.settimeout(PATIENCE)
        try:
            return self.outlives(b"")
        except TimeoutError:
            return False

    def outlives(self, data):
        """Return True if the server answers a ping after these bytes; False if it closes."""
        self._pings += 1
        number = self._pings.to_bytes(4, "big")
        try:
            self.send(data + bytes([0x89, 0x84, *bytes(4)]) + number)
            if hasattr(
                socket, "TCP_QUICKACK"
            ):  # otherwise a second answer waits 40 ms for the acknowledgement of the first
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
            while (frame := self._frame()) != (PONG, number):
                if frame[0] == CLOSE:
                    return False
        except (EOFError, ConnectionError):
            return False
        return True

    def end(self, data):
        """Send these bytes, close the sending side, and read until the server closes."""
        with suppress(EOFError, ConnectionError):
            self.send(data)
            self._socket.shutdown(socket.SHUT_WR)
            while True:
                self._frame()

    def close(self):
        self._socket.close()

    def subscribe(self, *topics):
        """Wait until all topics are advertised, and subscribe to them with their index as id."""
        channels = {}
        while not set(topics) <= set(channels):
            message = self.next()
            if isinstance(message, dict) and message["op"] == "advertise":
                channels |= {channel["topic"]: channel for channel in message["channels"]}
        expected = [{"id": k, "channelId": channels[topic]["id"]} for k, topic in enumerate(topics)]
        self.send_json(op="subscribe", subscriptions=expected)
        return [channels[topic] for topic in topics]

    def _frame(self):
        """Return kind and content of the next frame."""
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
    """Return a client of a process that may still be starting or compiling."""
    while process.poll() is None:
        try:
            return Client(port, timeout=300.0)
        except ConnectionRefusedError:
            continue
    raise AssertionError("the replay has ended")

"""Scripted Betaflight SITL: answers each state packet with motor outputs, and MSP status requests.

Written from the interface description and checked against the traffic of the real firmware: one motor packet for each
state packet, outputs 0 while disarmed, 0.055 when armed at low throttle.
"""

import select
import socket
import struct
import threading

from lapwing.services.betaflight.packets import MOTORS, RC, STATE

REQUEST = b"$M<\x00\x96\x96"


def free_ports():
    """Return the first of four consecutive free ports."""
    for first in range(21_000, 60_000, 40):
        sockets = []
        try:
            for port, kind in zip(range(first, first + 4), ["udp", "udp", "udp", "tcp"], strict=True):
                sockets.append(
                    socket.socket(socket.AF_INET, socket.SOCK_STREAM if kind == "tcp" else socket.SOCK_DGRAM)
                )
                sockets[-1].bind(("127.0.0.1", port))
            return first
        except OSError:
            continue
        finally:
            for each in sockets:
                each.close()
    raise AssertionError("no free ports")


def status_reply(armed=False, blockers=0):
    """Return an MSP_STATUS_EX reply of the firmware."""
    payload = struct.pack("<HHHIBHBB", 125, 0, 0x2B, int(armed), 0, 5, 4, 0) + b"\x00"
    payload += struct.pack("<BIBHB", 29, blockers, 0, 0, 4)
    body = bytes((len(payload), 150)) + payload
    check = 0
    for byte in body:
        check ^= byte
    return b"$M>" + body + bytes((check,))


class Peer:
    """Peer in a thread.

    Attributes:
        states: unpacked state packets.
        channels: newest RC channels.
        early: True if RC channels came before a request for the status, after which the firmware ignores RC.
    """

    def __init__(self, first, answer=None, blockers=0):
        """Listen from port `first` + 1; `answer(n, reply)` returns the packets to send instead of the motor packet."""
        self._first, self._answer, self._blockers = first, answer, blockers
        self.states, self.channels, self.early = [], (1000,) * 16, False
        self._asked = False
        self._state, self._rc = (self._udp(first + k) for k in (1, 2))
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._server.bind(("127.0.0.1", first + 3))
        self._server.listen()
        self._out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # socket of a second firmware
        self._clients, self._ending = [], False
        self._thread = threading.Thread(target=self._run, daemon=True)

    @staticmethod
    def _udp(port):
        result = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        result.bind(("127.0.0.1", port))
        return result

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ending = True
        self._thread.join()
        for each in (self._state, self._rc, self._server, self._out, self.other, *self._clients):
            each.close()

    def reopen(self):
        """Send from another port, as a restarted firmware."""
        self._out.close()
        self._out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def send(self, data, other=False):
        """Send to the simulator's port."""
        (self.other if other else self._out).sendto(data, ("127.0.0.1", self._first))

    def outputs(self):
        """Return the motor outputs for the sticks, equal for all four."""
        armed, throttle = self.channels[4] > 1700, self.channels[2]
        return (0.055 + 0.945 * max(0, throttle - 1050) / 950,) * 4 if armed else (0.0,) * 4

    def _run(self):
        while not self._ending:
            sources = [self._rc, self._state, self._server, *self._clients]  # RC first, as it was sent
            for each in select.select(sources, [], [], 0.05)[0]:
                if each is self._server:
                    self._clients.append(self._server.accept()[0])
                elif each is self._rc:
                    self.channels = RC.unpack(self._rc.recv(4096))[1:]
                    self.early = self.early or not self._asked
                elif each is self._state:
                    self.states.append(STATE.unpack(self._state.recv(4096)))
                    reply = MOTORS.pack(*self.outputs())
                    for packet in self._answer(len(self.states), reply) if self._answer else [reply]:
                        self.send(packet)
                else:
                    self._msp(each)

    def _msp(self, client):
        try:
            data = client.recv(4096)
        except OSError:
            data = b""
        if not data:
            self._clients.remove(client)
            client.close()
        elif REQUEST in data:
            self._asked = True
            client.sendall(status_reply(self.channels[4] > 1700, self._blockers))

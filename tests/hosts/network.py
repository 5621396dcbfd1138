"""Simulated network of hosts: namespaces, joined by a switch that delays and drops frames and disconnects hosts.

The switch is a thread that passes Ethernet frames between TAP devices, so that the TCP of the hosts experiences every
delay and loss. The kernel only needs namespaces and TAP devices.
"""

import fcntl
import heapq
import itertools
import os
import random
import select
import shutil
import struct
import subprocess
import threading
import time
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

_TUN = Path("/dev/net/tun")
_TUNSETIFF, _TAP, _NO_HEADER = 0x400454CA, 0x0002, 0x1000
_LARGEST = 65535  # [bytes] of a frame
_networks = itertools.count()  # networks of this process, of which several may exist at once


def why_not() -> str:
    """Return the reason why this machine cannot create such a network; "" if it can."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    if not shutil.which("ip") or not os.access(_TUN, os.W_OK):
        return f"network namespaces need the program ip and {_TUN}"
    name = f"lapwing-{os.getpid()}"
    if subprocess.run(["ip", "netns", "add", name], capture_output=True, check=False).returncode:
        return "no network namespace may be made here"
    subprocess.run(["ip", "netns", "delete", name], check=True)
    return ""


class Network:
    """Hosts by name, each with an address; the context creates them, and removes them with their processes.

    Attributes:
        addresses: of the hosts.
        delay: (shortest, longest) time [s] that a frame takes.
        loss: fraction of the frames that are lost.
        cut_off: hosts that neither send nor receive.
    """

    def __init__(self, hosts: Iterable[str], delay: tuple[float, float] = (0.0, 0.0), loss: float = 0.0, seed: int = 1):
        self.addresses = {name: f"10.211.0.{k}" for k, name in enumerate(hosts, 1)}
        self.delay, self.loss, self.cut_off = delay, loss, set[str]()
        self._chance = random.Random(seed)
        self._devices: dict[int, str] = {}  # host of each device, by descriptor
        self._stack = ExitStack()
        self._mark = f"{os.getpid()}-{next(_networks)}"
        self._wake, self._stop = os.pipe()

    def command(self, host: str, *words: str) -> list[str]:
        """Return the command line that runs `words` on a host."""
        return ["ip", "netns", "exec", self._namespace(host), *words]

    def _namespace(self, host: str) -> str:
        return f"lapwing-{self._mark}-{host}"

    def __enter__(self) -> "Network":
        self._stack.callback(lambda: [os.close(fd) for fd in (self._wake, self._stop)])
        try:
            for k, (host, address) in enumerate(self.addresses.items()):
                self._add(host, address, f"lw{self._mark}-{k}")
        except BaseException:
            self._stack.close()
            raise
        switch = threading.Thread(target=self._run)
        switch.start()
        self._stack.callback(lambda: (os.write(self._stop, b"."), switch.join()))
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._stack.close()

    def _add(self, host: str, address: str, device: str) -> None:
        namespace = self._namespace(host)
        _ip("netns", "add", namespace)
        self._stack.callback(_ip, "netns", "delete", namespace)
        descriptor = os.open(_TUN, os.O_RDWR | os.O_NONBLOCK)
        self._stack.callback(os.close, descriptor)
        fcntl.ioctl(descriptor, _TUNSETIFF, struct.pack("16sH", device.encode(), _TAP | _NO_HEADER))
        _ip("link", "set", device, "netns", namespace)
        for words in (("address", "add", f"{address}/24", "dev", device), ("link", "set", device, "up")):
            _ip("-netns", namespace, *words)
        _ip("-netns", namespace, "link", "set", "lo", "up")
        self._devices[descriptor] = host

    def _run(self) -> None:
        """Forward frames; each waits in a heap until it is due."""
        waiting: list[tuple[float, int, int, bytes]] = []  # (due, number, source descriptor, frame)
        latest: dict[int, float] = {}  # due time of the last frame of a host, to keep the order
        number = 0
        while True:
            left = max(0.0, waiting[0][0] - time.monotonic()) if waiting else None
            ready, _, _ = select.select([self._wake, *self._devices], [], [], left)
            if self._wake in ready:
                return
            now = time.monotonic()
            for device in ready:
                frame = os.read(device, _LARGEST)
                if self._devices[device] in self.cut_off or self._chance.random() < self.loss:
                    continue
                due = max(now + self._chance.uniform(*self.delay), latest.get(device, 0.0))
                latest[device], number = due, number + 1
                heapq.heappush(waiting, (due, number, device, frame))
            while waiting and waiting[0][0] <= time.monotonic():
                _, _, source, frame = heapq.heappop(waiting)
                for device, host in self._devices.items():
                    if device != source and host not in self.cut_off:
                        os.write(device, frame)  # hosts ignore frames for others


def _ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)

"""The bus: how messages travel between services. The only file that imports zenoh.

`ZenohBus` joins separate processes; the single-process mode needs no bus.
"""

import json
import os
import queue
import time
import uuid
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from messages.attachment import pack, source_time

# One runtime thread instead of six: the largest single gain in latency (see docs/benchmarks.md).
_RUNTIME = "(rx:(handover:app),acc:(handover:app),tx:(handover:app),net:(handover:app),app:(worker_threads:1))"
os.environ.setdefault("ZENOH_RUNTIME", _RUNTIME)

import zenoh  # noqa: E402  (reads ZENOH_RUNTIME when the first session opens)

LEASE_MS = 3000  # after this long without a sign of life a peer counts as gone


class BusError(RuntimeError):
    """The bus could not be opened."""


def _configuration(listen: Iterable[str], connect: Iterable[str], mode: str) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in {
        "mode": mode,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 1.5},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return config


class ZenohBus:
    """A session with explicit endpoints, publishers by key, and subscriptions that are queues."""

    def __init__(self, listen: Iterable[str] = (), connect: Iterable[str] = (), mode: str = "peer"):
        """Open the session.

        Raises:
            BusError: an endpoint cannot be listened on, or a client's router cannot be reached.
        """
        listen, connect = list(listen), list(connect)
        try:
            self._session = zenoh.open(_configuration(listen, connect, mode))
        except zenoh.ZError as error:
            endpoints = ", ".join(connect if mode == "client" else listen)
            action = "connect to" if mode == "client" else "listen on"
            raise BusError(f"cannot {action} {endpoints}: {str(error).partition(' at /')[0]}") from None
        self._gid = uuid.uuid4().bytes
        self._publishers: dict[str, tuple[zenoh.Publisher, Callable[[bytes, int], None]]] = {}
        self._held: list = []  # subscribers and tokens live as long as the session

    def publisher(self, key: str) -> Callable[[bytes, int], None]:
        """A function `put(payload, time_ns)` that publishes on `key`; messages of one key keep their order."""
        if key not in self._publishers:
            declared = self._session.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK)
            sequence = 0
            gid = self._gid

            def put(payload: bytes, time_ns: int) -> None:
                nonlocal sequence
                sequence += 1
                declared.put(payload, attachment=pack(sequence, time_ns, gid))

            self._publishers[key] = (declared, put)
        return self._publishers[key][1]

    def has_audience(self, keys: Iterable[str]) -> bool:
        """Whether somebody subscribes to one of the keys that this bus has a publisher for."""
        statuses = (self._publishers[key][0].matching_status for key in keys)
        return any(status.matching for status in statuses)  # type: ignore[attr-defined]  # the stub says bool

    def subscribe(self, *key_expressions: str, notify: Callable[[], None] | None = None) -> "Subscription":
        """Receive what is published on any of the keys, in order of arrival.

        `notify` is called from another thread after each arrival, for those who wait for other things besides.
        """
        arrived: queue.SimpleQueue = queue.SimpleQueue()

        def take(sample: zenoh.Sample) -> None:
            arrived.put(sample)
            notify()  # type: ignore[misc]

        for key_expression in key_expressions:
            handler = zenoh.handlers.Callback(take if notify else arrived.put, indirect=False)
            self._held.append(self._session.declare_subscriber(key_expression, handler))
        return Subscription(arrived)

    def declare_alive(self, key: str) -> None:
        """Say that this participant is there. Call it after `subscribe`: whoever sees it may publish."""
        self._held.append(self._session.liveliness().declare_token(key))

    def watch_alive(self, key_expression: str, seen: Callable[[str, bool], None]) -> None:
        """Call `seen(key, alive)` from another thread for every participant that is there, comes or goes."""

        def handle(sample: zenoh.Sample) -> None:
            seen(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        handler = zenoh.handlers.Callback(handle, indirect=False)
        self._held.append(self._session.liveliness().declare_subscriber(key_expression, handler, history=True))

    def answer(self, key: str, payload: bytes) -> None:
        """Give `payload` to everybody who asks for `key`."""
        handler: Any = zenoh.handlers.Callback(lambda query: query.reply(key, payload), indirect=False)
        self._held.append(self._session.declare_queryable(key, handler))

    def ask(self, key: str, timeout: float) -> bytes | None:
        """What somebody answers to `key`, None after `timeout` seconds."""
        for reply in self._session.get(key, timeout=timeout):
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
        return None

    def wait_alive(self, keys: Iterable[str], timeout: float, stop: Callable[[], bool] = lambda: False) -> list[str]:
        """Wait until a participant is there for each key; the keys still missing after `timeout` seconds."""
        missing = set(keys)
        arrivals: queue.SimpleQueue = queue.SimpleQueue()
        for folder in {key.rpartition("/")[0] for key in missing}:
            self.watch_alive(f"{folder}/*", lambda key, alive: arrivals.put((key, alive)))
        deadline = time.monotonic() + timeout
        while missing and time.monotonic() < deadline and not stop():
            try:
                key, alive = arrivals.get(timeout=0.05)
            except queue.Empty:
                continue
            if alive:
                missing.discard(key)
        return sorted(missing)

    def close(self) -> None:
        """Close the session; what was put before is delivered."""
        self._session.close()

    def __enter__(self) -> "ZenohBus":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Subscription:
    """What has arrived on some keys and was not taken yet."""

    def __init__(self, arrived: queue.SimpleQueue):
        self._arrived = arrived

    def get(self, timeout: float) -> tuple[int, bytes] | None:
        """Simulation time [ns] and payload of the next message, None after `timeout` seconds."""
        try:
            sample = self._arrived.get(timeout=timeout)
        except queue.Empty:
            return None
        return source_time(sample.attachment.to_bytes()), sample.payload.to_bytes()

    def get_with_key(self, timeout: float) -> tuple[str, int, bytes] | None:
        """The same with the message's key in front."""
        try:
            sample = self._arrived.get(timeout=timeout)
        except queue.Empty:
            return None
        return str(sample.key_expr), source_time(sample.attachment.to_bytes()), sample.payload.to_bytes()


def mesh(name: str, endpoints: Mapping[str, str]) -> tuple[list[str], list[str]]:
    """Where participant `name` listens and connects so that all are joined pairwise exactly once."""
    names = list(endpoints)
    return [endpoints[name]], [endpoints[other] for other in names[: names.index(name)]]

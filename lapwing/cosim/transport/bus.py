"""Zenoh session of a process: publishers, subscriptions, queries and liveliness. The only file that imports zenoh.

The single-process mode needs no bus.
"""

import json
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from types import MappingProxyType
from typing import Any

import zenoh

from lapwing.cosim.run_errors import BusError
from lapwing.cosim.transport.session_settings import one_runtime_thread, session_settings
from lapwing.cosim.transport.subscription import Inbox, Message, Subscription
from lapwing.messages.attachment import pack, time_and_gid

INBOX = 4096  # [messages] far more than arrive in lock step before one is read
WAKE = 0.05  # [s] between two checks of the deadlines of waiting threads

_opened = False


def in_use() -> bool:
    """Return True if this process has opened a session: a fork does not inherit Zenoh's threads and files."""
    return _opened


class ZenohBus:
    """Session with explicit endpoints, publishers by key, and queued subscriptions.

    Attributes:
        rejected: number of messages without a valid attachment, or from another sender.
    """

    def __init__(
        self,
        listen: Iterable[str] = (),
        connect: Iterable[str] = (),
        mode: str = "peer",
        gid: bytes = b"",
        security: Mapping[str, Any] = MappingProxyType({}),
        awaits: bool = True,
    ):
        """Open the session.

        Args:
            listen: endpoints that others connect to.
            connect: endpoints of others.
            mode: Zenoh mode: "peer", "client" or "router".
            gid: publisher GID of every message, 16 bytes; random by default.
            security: further entries of the Zenoh configuration, by key.
            awaits: True to wait up to half a second for a peer to connect.

        Raises:
            BusError: an endpoint cannot be listened on, or a client's router cannot be reached.
        """
        global _opened
        _opened = True
        listen, connect = list(listen), list(connect)
        try:
            with one_runtime_thread():
                settings = {**session_settings(listen, connect, mode, awaits), **security}
                self._session = zenoh.open(_zenoh_config(settings))
        except zenoh.ZError as error:
            tried = connect if mode == "client" else listen
            endpoints = ", ".join([endpoint for endpoint in tried if endpoint in str(error)] or tried)
            action = "connect to" if mode == "client" else "listen on"
            raise BusError(f"cannot {action} {endpoints}: {str(error).partition(' at /')[0]}") from None
        self._gid = gid or uuid.uuid4().bytes
        self.rejected = 0
        self._publishers: dict[str, tuple[zenoh.Publisher, Callable[[bytes, int], None]]] = {}
        self._declared: list = []  # subscribers and tokens live as long as the session
        self._inboxes: dict[str, Inbox] = {}  # by key
        self._waker = uuid.uuid4().bytes  # GID of the wake-up messages to its own inboxes
        self._closed = threading.Event()

    @property
    def session_id(self) -> str:
        """Zenoh's own identifier of this session, hexadecimal."""
        return str(self._session.info.zid())

    def publisher(self, key: str, gid: bytes = b"", drops: bool = False) -> Callable[[bytes, int], None]:
        """Return a function `put(payload, time_ns)` that publishes on `key`; messages of one key keep their order.

        Args:
            key: Zenoh key.
            gid: GID of its messages, 16 bytes; that of the bus by default.
            drops: drop messages for which a slow subscriber has no room, instead of waiting for it.
        """
        if key not in self._publishers:
            congestion_control = zenoh.CongestionControl.DROP if drops else zenoh.CongestionControl.BLOCK
            zenoh_publisher = self._session.declare_publisher(key, congestion_control=congestion_control)
            sequence = 0
            gid = gid or self._gid

            def put(payload: bytes, time_ns: int) -> None:
                nonlocal sequence
                sequence += 1
                zenoh_publisher.put(payload, attachment=pack(sequence, time_ns, gid))

            self._publishers[key] = (zenoh_publisher, put)
        return self._publishers[key][1]

    @contextmanager
    def until_closed(self) -> Iterator[None]:
        """Ignore that the bus is closed, as for a thread that does not know of the end of the run."""
        try:
            yield
        except zenoh.ZError:
            if not self._closed.is_set():
                raise

    def has_subscribers(self, keys: Iterable[str]) -> bool:
        """Return True if one of the keys, for which this bus has publishers, has a subscriber."""
        statuses = (self._publishers[key][0].matching_status for key in keys)
        return any(status.matching for status in statuses)  # type: ignore[attr-defined]  # the stub says bool

    def subscribe(self, *key_expressions: str) -> Subscription:
        """Subscribe to any sender on any of the keys, in order of arrival."""
        return self._receive(key_expressions, Subscription(_message, None, self._count_rejected))

    def receive(self, senders: Mapping[str, bytes | None], deferred: bool = False) -> Subscription:
        """Subscribe to known senders.

        Args:
            senders: GID of the messages by key; None to accept the GID of the first message.
            deferred: see `Subscription`.
        """
        return self._receive(senders, Subscription(_message, dict(senders), self._count_rejected, deferred))

    def inbox(self, key: str, sender: bytes | None) -> Inbox:
        """Subscribe to the sender with this GID on `key`; None accepts the GID of the first message.

        For messages that are read soon after their arrival: each keeps 64 kB of memory alive, and a full ring drops the
        oldest one.
        """
        subscriber = self._session.declare_subscriber(key, zenoh.handlers.RingChannel(INBOX))
        self._declared.append(subscriber)
        result = Inbox(subscriber.handler.recv, _message, sender, self._waker, self._count_rejected)
        if not self._inboxes:
            threading.Thread(target=self._wake, daemon=True).start()
        self._inboxes[key] = result
        return result

    def _wake(self) -> None:
        """Wake threads whose deadline at an inbox has passed: Zenoh's queues have no time-out."""
        while not self._closed.wait(WAKE):
            for key, inbox in list(self._inboxes.items()):
                if time.monotonic() >= inbox.deadline:
                    own_session = zenoh.Locality.SESSION_LOCAL
                    with suppress(zenoh.ZError):  # the session is closed
                        self._session.put(key, b"", attachment=pack(0, 0, self._waker), allowed_destination=own_session)

    def _receive(self, keys: Iterable[str], subscription: Subscription) -> Subscription:
        handler = zenoh.handlers.Callback(subscription.arrive, indirect=False)
        self._declared.extend(self._session.declare_subscriber(key, handler) for key in keys)
        return subscription

    def _count_rejected(self) -> None:
        self.rejected += 1

    def declare_liveliness(self, key: str) -> Callable[[], None]:
        """Declare that this participant is present, until the returned function is called.

        Call it after `subscribe`: a participant that sees the declaration may publish.
        """
        token = self._session.liveliness().declare_token(key)
        self._declared.append(token)
        return token.undeclare

    def watch_liveliness(self, key_expression: str, on_change: Callable[[str, bool], None]) -> None:
        """Call `on_change(key, alive)` from another thread for every participant that is present, joins or leaves."""

        def handle(sample: zenoh.Sample) -> None:
            on_change(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        handler = zenoh.handlers.Callback(handle, indirect=False)
        self._declared.append(self._session.liveliness().declare_subscriber(key_expression, handler, history=True))

    def answer(self, key: str, payload: bytes) -> None:
        """Reply with `payload` to every query for `key`."""

        def reply(query: zenoh.Query) -> None:
            query.reply(key, payload, attachment=pack(0, 0, self._gid))

        # In a separate thread: in Zenoh's only thread, a reply of several fragments would wait for itself
        handler: Any = zenoh.handlers.Callback(reply, indirect=True)
        self._declared.append(self._session.declare_queryable(key, handler))

    def query(self, key: str, timeout: float) -> bytes | None:
        """Return the first reply to a query for `key`, None after `timeout` seconds."""
        for reply in self._session.get(key, timeout=timeout):
            if reply.ok is not None:
                return reply.ok.payload.to_bytes()
        return None

    def close(self) -> None:
        """Close the session.

        Messages put just before may be lost (`tests/cosim/test_close.py`). A publisher whose messages must arrive waits
        for their confirmation, as `lapwing.cosim.executors.participant.Participant.leave` does.
        """
        self._closed.set()
        with suppress(zenoh.ZError):
            self._session.close()

    def __enter__(self) -> "ZenohBus":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _zenoh_config(settings: Mapping[str, Any]) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


def _message(sample: zenoh.Sample) -> Message | None:
    """Return the message of a sample; None if its attachment is invalid, or if it deletes a key."""
    attachment = sample.attachment
    if attachment is None:
        return None
    try:
        time_ns, gid = time_and_gid(attachment.to_bytes())
    except ValueError:
        return None
    payload = sample.payload.to_bytes()
    if not payload and sample.kind != zenoh.SampleKind.PUT:
        return None
    return time_ns, gid, payload

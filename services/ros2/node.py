"""A node of a ROS 2 graph: a separate Zenoh session with the declarations that rmw_zenoh (Jazzy and later) expects.

A topic's key is `<domain>/<topic>/<type>/<type hash>`. A node and each of its publishers and subscriptions declare a
liveliness token, which `ros2 node list` and `ros2 topic list` show; in it, `%` replaces `/`.

Type hashes are those of REP 2011 (RIHS01): SHA-256 of the fields of a type and of all types in it. Two nodes exchange
messages only if their hashes agree.
"""

import hashlib
import json
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple, Self

from lapwing.cosim.run_errors import BusError
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.subscription import Subscription
from lapwing.messages import TYPES
from lapwing.messages.parse import Definition, Field, dependencies
from lapwing.messages.types import DEFINITIONS
from lapwing.services.common.address import host_and_port, is_loopback

NODE, PUBLISHER, SUBSCRIPTION = "NN", "MP", "MS"
QOS = "::,10:,:,:,,"  # ROS 2's defaults: reliable, volatile, the last 10
NAME = "lapwing"  # name of the node
_ROOT = "%"  # an empty enclave, and the namespace "/"


class Endpoint(NamedTuple):
    """A topic of a graph: its name with a leading slash, and its type, "sensor_msgs/msg/Imu"."""

    topic: str
    type_name: str

    def key(self, domain: int) -> str:
        """Return the Zenoh key of its messages."""
        return f"{domain}/{self.topic.lstrip('/')}/{self._type}"

    @property
    def _type(self) -> str:
        package, kind, name = self.type_name.split("/")
        return f"{package}::{kind}::dds_::{name}_/{known_type_hash(self.type_name)}"

    def token(self, domain: int, session: str, number: int, kind: str) -> str:
        """Return the liveliness token of the node's `number`-th publisher or subscription."""
        return f"{_entity(domain, session, number, kind)}/{self.topic.replace('/', '%')}/{self._type}/{QOS}"


def node_token(domain: int, session: str) -> str:
    """Return the liveliness token of the node, the only one of its session."""
    return _entity(domain, session, 0, NODE)


def identifier(token: str) -> bytes:
    """Return the 16-byte publisher GID of a token, for the attachment of its messages."""
    return hashlib.blake2b(token.encode(), digest_size=16).digest()


def _entity(domain: int, session: str, number: int, kind: str) -> str:
    return f"@ros2_lv/{domain}/{session}/0/{number}/{kind}/{_ROOT}/{_ROOT}/{NAME}"


# Numbers of type_description_interfaces/msg/FieldType; in a .msg file char is another name of uint8.
_NESTED = 1
_TYPE_IDS = {
    "int8": 2,
    "uint8": 3,
    "char": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "string": 17,
}
_ARRAY, _SEQUENCE = 48, 144  # added to the type id for `T[n]` and `T[]`


def type_hash(type_name: str, definitions: Mapping[str, Definition]) -> str:
    """Return the hash of a type, "RIHS01_" and 64 hexadecimal digits; `definitions` has all types by full name."""
    contained = sorted(set(dependencies(type_name, dict(definitions))))
    description = {
        "type_description": _describe(definitions[type_name]),
        "referenced_type_descriptions": [_describe(definitions[name]) for name in contained],
    }
    return "RIHS01_" + hashlib.sha256(json.dumps(description).encode()).hexdigest()


@cache
def known_type_hash(type_name: str) -> str:
    """Return the `type_hash` of a type of `messages/msg` by its full name."""
    return type_hash(type_name, DEFINITIONS)


def _describe(definition: Definition) -> dict[str, Any]:
    return {"type_name": definition.type_name, "fields": [_field(field) for field in definition.fields]}


def _field(field: Field) -> dict[str, Any]:
    array_id = 0 if field.length is None else _ARRAY if field.length else _SEQUENCE
    kind = {
        "type_id": array_id + (_NESTED if field.nested else _TYPE_IDS[field.base]),
        "capacity": field.length or 0,
        "string_capacity": 0,  # no bounded strings
        "nested_type_name": field.base if field.nested else "",
    }
    return {"name": field.name, "type": kind}


ROUTER = "127.0.0.1:7447"  # default router of rmw_zenoh
# Nodes discover each other as with rmw_zenoh's own router, and then communicate directly.
_SETTINGS = {"scouting/gossip/enabled": True, "transport/unicast/open_timeout": 3000}


def parse_router(text: str, insecure: bool) -> tuple[str, bool]:
    """Return the Zenoh endpoint of a router HOST:PORT, and True if it is on this machine.

    Raises:
        ValueError: the form is wrong, or it is another machine, which is not authenticated, without `insecure`.
    """
    result = host_and_port(text)
    if result is None:
        raise ValueError(f"--ros2-router {text}: expected HOST:PORT, for example {ROUTER}")
    host, port = result
    local = is_loopback(host)
    if not local and not insecure:
        raise ValueError(
            f"--ros2-router {text}: programs of that host could send commands; use --insecure to allow them"
        )
    url_host = f"[{host}]" if ":" in host else host
    return f"tcp/{url_host}:{port}", local


class CommandSubscription:
    """Queue of messages from other nodes."""

    def __init__(self, subscription: Subscription, topics: dict[str, str]):
        """Wrap a subscription with the topic of each key."""
        self._subscription, self._topics = subscription, topics

    def get(self) -> tuple[str, bytes] | None:
        """Return topic and payload of the next message. Return None if there is none."""
        result = self._subscription.get_with_key(timeout=0.0)
        return result and (self._topics[result[0]], result[2])


class Node:
    """Node of a ROS 2 graph; a context manager."""

    def __init__(self, domain: int, router: str = ROUTER, insecure: bool = False):
        """Join a graph through its router; if this machine has none, run the router.

        Args:
            domain: ROS_DOMAIN_ID of the graph.
            router: HOST:PORT.
            insecure: True if the router may be on another machine.

        Raises:
            ValueError: the router's address is invalid, or cannot be reached.
        """
        endpoint, local = parse_router(router, insecure)
        self._domain, self._entities = domain, 0
        self._bus = _open(endpoint, local)
        self._puts: dict[str, Callable[[bytes, int], None]] = {}
        self._bus.declare_liveliness(node_token(domain, self._bus.session_id))

    def declare(self, topic: str, type_name: str) -> None:
        """Declare a topic to publish, "/drone1/imu"; types without a message class are ignored."""
        if topic in self._puts or type_name not in TYPES:
            return
        endpoint = Endpoint(topic, type_name)
        token = self._token(endpoint, PUBLISHER)
        # A node that is too slow misses messages, as with rmw_zenoh's own publishers; it does not delay the run.
        self._puts[topic] = self._bus.publisher(endpoint.key(self._domain), identifier(token), drops=True)
        self._bus.declare_liveliness(token)

    def put(self, topic: str, time_ns: int, payload: bytes) -> None:
        """Publish a message of a declared topic, stamped with the simulation time [ns]."""
        if topic in self._puts:
            self._puts[topic](payload, time_ns)

    def publishers(self) -> set[str]:
        """Return a set of the topics that other nodes publish, which grows while nodes appear."""
        topics: set[str] = set()

        def note(token: str, alive: bool) -> None:
            if alive and token.split("/")[5:6] == [PUBLISHER]:
                topics.add(token.split("/")[9].replace("%", "/"))

        self._bus.watch_liveliness(f"@ros2_lv/{self._domain}/**", note)
        return topics

    def subscribe(self, messages: dict[str, Any]) -> "CommandSubscription":
        """Subscribe to topics of other nodes; `messages` has the message class by topic."""
        endpoints = [Endpoint(topic, message.type_name) for topic, message in messages.items()]
        topics = {endpoint.key(self._domain): endpoint.topic for endpoint in endpoints}
        commands = CommandSubscription(self._bus.subscribe(*topics), topics)
        for endpoint in endpoints:
            self._bus.declare_liveliness(self._token(endpoint, SUBSCRIPTION))
        return commands

    def _token(self, endpoint: Endpoint, kind: str) -> str:
        self._entities += 1
        return endpoint.token(self._domain, self._bus.session_id, self._entities, kind)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._bus.close()


def _open(endpoint: str, local: bool) -> ZenohBus:
    if local:
        try:
            return ZenohBus([endpoint], mode="router", security=_SETTINGS)
        except BusError:  # the port is in use, normally by a router
            pass
    try:
        return ZenohBus(connect=[endpoint], mode="client", security=_SETTINGS)
    except BusError as error:
        raise ValueError(f"--ros2: {error}; expected a Zenoh router there (--ros2-router HOST:PORT)") from None

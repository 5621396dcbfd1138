"""A node of a ROS 2 graph: a separate Zenoh session with the declarations that rmw_zenoh expects."""

from collections.abc import Callable
from typing import Any, Self

from lapwing.cosim.run_errors import BusError
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.subscription import Subscription
from lapwing.messages import TYPES
from lapwing.services.common.address import host_and_port, is_loopback
from lapwing.services.ros2.rmw_zenoh_names import PUBLISHER, SUBSCRIPTION, Endpoint, identifier, node_token

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

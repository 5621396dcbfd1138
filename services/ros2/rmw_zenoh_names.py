"""How rmw_zenoh (Jazzy and later) names topics, and how it says who is there (its docs/design.md).

A topic's key is `<domain>/<topic>/<type>/<type hash>`. A node and each of its publishers and subscriptions declare a
liveliness token of which `ros2 node list` and `ros2 topic list` are made; in it, `%` stands for `/`.
"""

import hashlib
from typing import NamedTuple

from lapwing.messages.type_hash import known_type_hash

NODE, PUBLISHER, SUBSCRIPTION = "NN", "MP", "MS"
QOS = "::,10:,:,:,,"  # all as ROS 2's default: reliable, volatile, the last 10
NAME = "lapwing"  # of the node
_ROOT = "%"  # stands for an empty enclave and for the namespace "/"


class Endpoint(NamedTuple):
    """A topic of a graph: its name with a leading slash, and its type, "sensor_msgs/msg/Imu"."""

    topic: str
    type_name: str

    def key(self, domain: int) -> str:
        """The Zenoh key of its messages."""
        return f"{domain}/{self.topic.lstrip('/')}/{self._type}"

    @property
    def _type(self) -> str:
        package, kind, name = self.type_name.split("/")
        return f"{package}::{kind}::dds_::{name}_/{known_type_hash(self.type_name)}"

    def token(self, domain: int, session: str, number: int, kind: str) -> str:
        """The liveliness token of our publisher or subscription, the `number`-th of the node."""
        return f"{_entity(domain, session, number, kind)}/{self.topic.replace('/', '%')}/{self._type}/{QOS}"


def node_token(domain: int, session: str) -> str:
    """The liveliness token of the node, which is the first and only one of its session."""
    return _entity(domain, session, 0, NODE)


def identifier(token: str) -> bytes:
    """16 bytes that tell a publisher from all others, for the attachment of its messages."""
    return hashlib.blake2b(token.encode(), digest_size=16).digest()


def _entity(domain: int, session: str, number: int, kind: str) -> str:
    return f"@ros2_lv/{domain}/{session}/0/{number}/{kind}/{_ROOT}/{_ROOT}/{NAME}"

"""Keys and liveliness tokens of rmw_zenoh (Jazzy and later; its docs/design.md).

A topic's key is `<domain>/<topic>/<type>/<type hash>`. A node and each of its publishers and subscriptions declare a
liveliness token, which `ros2 node list` and `ros2 topic list` show; in it, `%` replaces `/`.
"""

import hashlib
from typing import NamedTuple

from lapwing.messages.type_hash import known_type_hash

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

"""The parameter protocol's messages."""

from typing import TYPE_CHECKING, Any

from services.mavlink.client import Client
from services.mavlink.protocols.handler import handles

if TYPE_CHECKING:
    from services.mavlink.adapter import Adapter


@handles("PARAM_REQUEST_LIST")
def request_list(adapter: "Adapter", client: Client, m: Any) -> None:
    """All of them."""
    adapter.parameters.start_list(client)


@handles("PARAM_REQUEST_READ")
def request_read(adapter: "Adapter", client: Client, m: Any) -> None:
    """One of them."""
    adapter.parameters.read(client, m.param_id, m.param_index)


@handles("PARAM_SET")
def set_(adapter: "Adapter", client: Client, m: Any) -> None:
    """Another value for one."""
    adapter.parameters.set(client, m.param_id, m.param_value, adapter.trusts(client))

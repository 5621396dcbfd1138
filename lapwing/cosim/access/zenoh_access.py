"""Zenoh access-control rules for both ends of every link. The default is to deny."""

from collections.abc import Iterable, Mapping
from typing import Any

from lapwing.cosim.access.private_sockets import SCHEME
from lapwing.cosim.transport.bus_keys import CONFIG_KEY

VIEWER = "viewer"  # common name of the certificate that may read and not publish

_LISTEN = ["declare_subscriber", "declare_liveliness_subscriber", "liveliness_query"]
_PUBLISH = ["put", "liveliness_token", "declare_queryable", "reply"]
_VIEWING = {"rules": ["receive", "listen", "withhold"], "subjects": [VIEWER]}
_ALL = [*_LISTEN, *_PUBLISH, "query", "delete"]


def by_certificate(key_prefix: str, publishable: Mapping[str, Iterable[str]]) -> dict[str, Any]:
    """Return Zenoh's settings for a run whose participants have certificates.

    Args:
        key_prefix: key prefix of the run.
        publishable: key expressions that a participant may publish, by the common name of its certificate.
    """
    everything = f"{key_prefix}/**"
    rules = [
        *_reading(everything),
        _rule("query", ["query"], "ingress", [f"{key_prefix}/{CONFIG_KEY}/*"]),
        *(_rule(f"publish {name}", _PUBLISH, "ingress", keys) for name, keys in publishable.items()),
    ]
    subjects = [{"id": name, "cert_common_names": [name]} for name in [*publishable, VIEWER]]
    policies = [
        {"rules": ["receive", "listen", "query", f"publish {name}"], "subjects": [name]} for name in publishable
    ]
    return _settings([*rules, _withheld(key_prefix)], subjects, [*policies, _VIEWING])


def door(key_prefix: str, certificates: bool) -> dict[str, Any]:
    """Return the Zenoh settings for the open endpoint of a run on one machine: its clients read, and publish nothing.

    Args:
        key_prefix: key prefix of the run.
        certificates: True to accept only the viewer's certificate.
    """
    inside = {"id": "inside", "link_protocols": [SCHEME.rstrip("/")]}
    outside = {"id": VIEWER, "cert_common_names": [VIEWER]}
    if not certificates:
        outside = {"id": VIEWER, "link_protocols": ["tcp", "udp", "ws", "quic"]}
    rules = [*_reading(f"{key_prefix}/**"), _rule("all", _ALL, "ingress", ["**"]), _rule("any", _ALL, "egress", ["**"])]
    policies = [{"rules": ["all", "any"], "subjects": ["inside"]}]
    return _settings([*rules, _withheld(key_prefix)], [inside, outside], [*policies, _VIEWING])


def without_viewers(key_prefix: str) -> dict[str, Any]:
    """Return the Zenoh settings for a router that cannot authenticate viewers; participants are linked without it."""
    policies = [{"rules": ["withhold"], "subjects": ["any"]}]
    return _settings([_withheld(key_prefix)], [{"id": "any"}], policies, default="allow")


def _reading(key: str) -> list[dict[str, Any]]:
    return [_rule("receive", _ALL, "egress", [key]), _rule("listen", _LISTEN, "ingress", [key])]


def _withheld(key_prefix: str) -> dict[str, Any]:
    """Return the rule that keeps lock-step messages from viewers: a sender would wait for a viewer that stops
    reading."""
    return _rule("withhold", ["put", "delete"], "egress", [f"{key_prefix}/_$*/**"]) | {"permission": "deny"}


def _rule(name: str, messages: list[str], flow: str, keys: Iterable[str]) -> dict[str, Any]:
    return {"id": name, "messages": messages, "flows": [flow], "permission": "allow", "key_exprs": list(keys)}


def _settings(rules: list, subjects: list, policies: list, default: str = "deny") -> dict[str, Any]:
    settings = {"enabled": True, "default_permission": default, "rules": rules, "subjects": subjects}
    return {"access_control": {**settings, "policies": policies}}

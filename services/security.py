"""Publishing permissions of each participant, from the process table and the topics of its services."""

from pathlib import Path
from typing import Any

from lapwing.cosim.access.certificates import tls
from lapwing.cosim.access.zenoh_access import by_certificate, door, without_viewers
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.cosim.transport.bus_keys import ENCODER
from lapwing.messages.topics import EVENTS
from lapwing.services.process_table import PROCESSES, ROUTER, certificate_name, create


def names() -> list[str]:
    """Return the names of all possible participants of a run."""
    encoders = [f"{process.name}{ENCODER}" for process in PROCESSES if process.lock_step]
    return [*(process.name for process in PROCESSES), *encoders, MONITOR]


def publish_permissions(config: RunConfig, key_prefix: str) -> dict[str, list[str]]:
    """Return the key expressions that each participant may publish on, by the name in its certificate."""
    result = {name: [f"{key_prefix}/*/{name}"] for name in names()}
    result[MONITOR] += [EVENTS.zenoh_key(vehicle, key_prefix) for vehicle in config.vehicles]
    for name in config.services:
        topics = [topic.zenoh_key(config.vehicle, key_prefix) for topic in create(config, name).topics]
        encoder = f"{name}{ENCODER}"
        result[certificate_name(name)] += [*topics, f"{key_prefix}/*/{name}"]
        result[certificate_name(encoder)] += [*topics, f"{key_prefix}/*/{name}", f"{key_prefix}/*/{encoder}"]
    return {name: list(dict.fromkeys(keys)) for name, keys in result.items()}


def settings(config: RunConfig, name: str, key_prefix: str, keys: str) -> dict[str, Any]:
    """Return the Zenoh settings for the links of a participant of a run on several hosts.

    Without a folder of certificates, only a router has settings: it withholds the lock step from its clients.

    Raises:
        ValueError: the certificate cannot be used.
    """
    if not keys:
        return without_viewers(key_prefix) if name == ROUTER else {}
    return {
        **tls(Path(keys), certificate_name(name)),
        **by_certificate(key_prefix, publish_permissions(config, key_prefix)),
    }


def door_settings(name: str, key_prefix: str, keys: str) -> dict[str, Any]:
    """Return the Zenoh settings for the process that accepts clients of a run on one machine.

    Raises:
        ValueError: the certificate cannot be used.
    """
    return {**(tls(Path(keys), certificate_name(name)) if keys else {}), **door(key_prefix, bool(keys))}

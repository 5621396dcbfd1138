"""What each participant of a run may publish, from the process table and the topics of its services; and the settings
of its links that follow."""

from pathlib import Path
from typing import Any

from lapwing.cosim.access.certificates import tls
from lapwing.cosim.access.zenoh_access import by_certificate, door, withholding
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.cosim.transport.bus_keys import ENCODER
from lapwing.messages.topics import EVENTS
from lapwing.services.process_table import PROCESSES, ROUTER, create


def names() -> list[str]:
    """Everybody who can take part in a run."""
    makers = [f"{process.name}{ENCODER}" for process in PROCESSES if process.lock_step]
    return [*(process.name for process in PROCESSES), *makers, MONITOR]


def says(setup: RunConfig, key_prefix: str) -> dict[str, list[str]]:
    """The key expressions that each may publish on, by name."""
    found = {name: [f"{key_prefix}/*/{name}"] for name in names()}
    found[MONITOR] += [EVENTS.zenoh_key(vehicle, key_prefix) for vehicle in setup.vehicles]
    for name in setup.services:
        topics = [topic.zenoh_key(setup.vehicle, key_prefix) for topic in create(setup, name).topics]
        found[name] += topics
        found[f"{name}{ENCODER}"] += [*topics, f"{key_prefix}/*/{name}"]
    return found


def settings(setup: RunConfig, name: str, key_prefix: str, keys: str) -> dict[str, Any]:
    """Zenoh's settings for the links of a participant of a run on several hosts.

    Without a folder of certificates there are none, but that a router withholds the lock step from whom it lets in.

    Raises:
        ValueError: its certificate cannot be used.
    """
    if not keys:
        return withholding(key_prefix) if name == ROUTER else {}
    return {**tls(Path(keys), name), **by_certificate(key_prefix, says(setup, key_prefix))}


def door_settings(name: str, key_prefix: str, keys: str) -> dict[str, Any]:
    """Zenoh's settings for whoever lets clients into a run on one machine.

    Raises:
        ValueError: its certificate cannot be used.
    """
    return {**(tls(Path(keys), name) if keys else {}), **door(key_prefix, bool(keys))}

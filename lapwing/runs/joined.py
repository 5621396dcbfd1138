"""A run whose services are started elsewhere: watched to its end."""

import re
import time
from collections.abc import Iterable

from cosim.bus import ZenohBus, mesh
from cosim.interrupt import Stop
from cosim.key_prefix import check_key_prefix
from cosim.keys import ALIVE_KEY
from cosim.launcher import RunFailed
from cosim.setup import Setup
from cosim.watch import WATCHER, Watch
from lapwing.runs.observer import Elapsed, Observer
from lapwing.runs.processes import Clock
from services import processes

JOIN_TIMEOUT = 120.0  # [s] the services elsewhere get to appear


def fly_joined(setup: Setup, peers: dict[str, str], key_prefix: str, observer: Observer) -> Elapsed:
    """Watch a run whose services are started elsewhere, to its end.

    Raises:
        RunFailed: a service does not come, or is gone before the end.
        ValueError: not a key prefix.
        Interrupted: ended by a signal.
    """
    check_key_prefix(key_prefix)
    clock = Clock(observer, setup)
    names = set(processes.needed(setup))
    listen, connect = mesh(WATCHER, peers)
    with Stop() as stop, ZenohBus(listen, connect) as bus:
        watch = Watch(bus, key_prefix)
        bus.declare_alive(f"{key_prefix}/{ALIVE_KEY}/{WATCHER}")
        deadline = time.monotonic() + JOIN_TIMEOUT
        while not (watch.ended and processes.RECORDER in watch.gone):
            watch.poll(0.2)
            clock.observe(watch)
            stop.check()
            if not names <= watch.present:
                watch.last_news = time.monotonic()
                if time.monotonic() > deadline:
                    raise RunFailed(f"nobody answers as {', '.join(sorted(names - watch.present))}")
            elif not watch.ended and watch.gone & names:
                raise RunFailed(f"{', '.join(sorted(watch.gone))}: gone at t = {watch.time_ns * 1e-9:.3f} s")
            elif culprit := watch.frozen(names):
                raise RunFailed(culprit)
    return clock.elapsed


def parse_peers(text: str, needed: Iterable[str] = ()) -> dict[str, str]:
    """ "name=endpoint,..." as a table.

    Args:
        text: the table as the user gave it.
        needed: names that it must have.

    Raises:
        ValueError: not of this form, no endpoint, or a name that is missing.
    """
    peers = dict(pair.split("=", 1) for pair in text.split(",") if "=" in pair)
    if not peers or len(peers) != len(text.split(",")):
        raise ValueError(f"--peers {text}: expected name=endpoint,..., for example plant=tcp/plant:7447")
    for endpoint in peers.values():
        check_endpoint("--peers", endpoint)
    if missing := [name for name in needed if name not in peers]:
        raise ValueError(f"--peers {text}: no endpoint for {', '.join(missing)}")
    return peers


def parse_external(texts: Iterable[str], setup: Setup) -> dict[str, str]:
    """Each "name=endpoint" as a table.

    Raises:
        ValueError: not of this form, no endpoint, or no service of the lock step that could be elsewhere.
    """
    found = {}
    for text in texts:
        name, _, endpoint = text.partition("=")
        choices = [service for service in setup.services if service != processes.TIME_OWNER]
        if name not in choices:
            raise ValueError(f"--external {text}: expected NAME=ENDPOINT with one of {', '.join(choices)}")
        check_endpoint(f"--external {name}", endpoint)
        found[name] = endpoint
    return found


def check_endpoint(option: str, text: str) -> None:
    """Refuse what is no Zenoh endpoint.

    Raises:
        ValueError: not of the form protocol/address:port.
    """
    if not re.fullmatch(r"(tcp|udp|tls|quic|ws)/[^/\s]+:\d+", text):
        raise ValueError(f"{option} {text}: expected an endpoint protocol/address:port, for example tcp/127.0.0.1:7447")

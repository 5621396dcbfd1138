"""Monitoring of a run whose services are started separately."""

import re
import time
from collections.abc import Callable, Iterable, Mapping

from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.processes.interrupt import Stop
from lapwing.cosim.processes.run_monitor import MONITOR, RunMonitor
from lapwing.cosim.run_errors import RunFailed
from lapwing.cosim.transport.bus import ZenohBus, mesh
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, ENCODER
from lapwing.cosim.transport.key_prefix import check_key_prefix
from lapwing.runs.multi_process_run import Clock
from lapwing.runs.observer import Elapsed, Observer
from lapwing.services import process_table
from lapwing.services.process_main import ProcessSpec
from lapwing.services.security import settings

LOST = 6.0  # [s] without news after which a run counts as lost: after a cut of 2 s, TCP takes up to 4 s to send again
GRACE = 2.0  # [s] that links of one run may differ by
JOIN_TIMEOUT = 120.0  # [s] the services elsewhere get to appear
CLOSE_TIMEOUT = 5.0  # [s] the recorder gets to close its log when a run has failed


def monitor_run(
    given: ProcessSpec, observer: Observer, live: Callable[[RunMonitor], None] = lambda watch: None
) -> Elapsed:
    """Monitor a run whose services are started separately to its end; `live` is called about five times a second.

    Raises:
        RunFailed: a service does not come, or is gone before the end.
        ValueError: not a key prefix, or its certificate cannot be used.
        Interrupted: ended by a signal.
    """
    setup, peers, key_prefix = given.setup, given.peers, given.key_prefix
    check_key_prefix(key_prefix)
    external = given.external or {}
    clock, participants = Clock(observer, setup), PublisherIds(key_prefix, external=tuple(external))
    names = set(process_table.required_processes(setup, external))
    listen, connect = mesh(MONITOR, peers)
    gid, security = participants.gid(MONITOR), settings(setup, MONITOR, key_prefix, given.keys)
    with Stop() as stop, ZenohBus(listen, connect, gid=gid, security=security) as bus:
        watch = RunMonitor(bus, participants, peers, LOST, setup.services)
        leave = bus.declare_alive(f"{key_prefix}/{ALIVE_KEY}/{MONITOR}")
        try:
            _follow(watch, clock, stop, names, live)
        except RunFailed:
            leave()  # at which the others end
            deadline = time.monotonic() + CLOSE_TIMEOUT
            while names <= watch.present and process_table.RECORDER not in watch.gone and time.monotonic() < deadline:
                watch.poll(0.2)
            raise
    return clock.elapsed


def _follow(watch: RunMonitor, clock: Clock, stop: Stop, names: set[str], live: Callable[[RunMonitor], None]) -> None:
    """Monitor the run of the participants `names` to its end. See `monitor_run` for errors."""
    deadline = time.monotonic() + JOIN_TIMEOUT
    while not (watch.ended and process_table.RECORDER in watch.gone):
        live(watch)
        watch.poll(0.2)
        clock.observe(watch)
        stop.check()
        if not names <= watch.present:
            watch.last_news = time.monotonic()
            if time.monotonic() > deadline:
                raise RunFailed(f"no participant {', '.join(sorted(names - watch.present))} within {JOIN_TIMEOUT:g} s")
        elif not watch.ended and watch.gone & names and not _comes(watch, lambda: watch.ended, GRACE):
            raise RunFailed(f"{', '.join(sorted(watch.gone))}: gone at t = {watch.time_ns * 1e-9:.3f} s")
        elif watch.began is None and time.monotonic() < deadline:
            watch.last_news = time.monotonic()  # set-ups are compared, which takes a while over a slow network
        elif culprit := watch.stall_message(names):
            raise RunFailed(culprit)
    # After a cut, links recover one by one; the clock owner stays until its outcome is confirmed
    others = names - {process_table.RECORDER}
    _comes(watch, lambda: watch.outcome is not None or bool(watch.gone & others), LOST)
    live(watch)
    if early := watch.abort_message():
        raise RunFailed(early)


def _comes(watch: RunMonitor, news: Callable[[], bool], seconds: float) -> bool:
    """Return True if `news` becomes true within `seconds`; the loss of a participant may arrive earlier."""
    deadline = time.monotonic() + seconds
    while not news() and time.monotonic() < deadline:
        watch.poll(0.2)
    return news()


def parse_endpoints(text: str) -> dict[str, str]:
    """Return "name=endpoint,..." as a table, external services first: all others connect to them.

    Raises:
        ValueError: not of this form, or no endpoint.
    """
    peers = dict(pair.split("=", 1) for pair in text.split(",") if "=" in pair)
    if not peers or len(peers) != len(text.split(",")):
        raise ValueError(f"--endpoints {text}: expected name=endpoint,..., for example plant=tcp/plant:7447")
    for endpoint in peers.values():
        check_endpoint("--endpoints", endpoint)
    return {**external_services(peers), **peers}


def check_complete(peers: Mapping[str, str], needed: Iterable[str]) -> None:
    """Refuse a table of participants that lacks one.

    Raises:
        ValueError: names those that are missing.
    """
    if missing := [name for name in needed if name not in peers]:
        raise ValueError(f"--endpoints: no endpoint for {', '.join(missing)}")


def external_services(peers: Mapping[str, str]) -> dict[str, str]:
    """Return the external services of a table: those with a separate process that encodes their messages."""
    return {name: endpoint for name, endpoint in peers.items() if f"{name}{ENCODER}" in peers}


def parse_external(texts: Iterable[str], setup: RunConfig) -> dict[str, str]:
    """Return each "name=endpoint" as a table.

    Raises:
        ValueError: not of this form, no endpoint, or no service of the lock step that could be elsewhere.
    """
    result = {}
    for text in texts:
        name, _, endpoint = text.partition("=")
        choices = [service for service in setup.services if service != process_table.CLOCK_OWNER]
        if name not in choices:
            raise ValueError(f"--external {text}: expected NAME=ENDPOINT with one of {', '.join(choices)}")
        check_endpoint(f"--external {name}", endpoint)
        result[name] = endpoint
    return result


def check_endpoint(option: str, text: str) -> None:
    """Refuse what is no Zenoh endpoint.

    Raises:
        ValueError: not of the form protocol/address:port, and no path of a Unix-domain socket.
    """
    if not re.fullmatch(r"(tcp|udp|tls|quic|ws)/[^/\s]+:\d+|unixsock-stream/\S+", text):
        raise ValueError(f"{option} {text}: expected an endpoint protocol/address:port, for example tcp/127.0.0.1:7447")

"""Run with services that are started separately."""

import re
import time
from collections.abc import Callable, Iterable, Mapping

from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.processes.interrupt import Stop
from lapwing.cosim.processes.run_monitor import MONITOR, RunMonitor
from lapwing.cosim.run_errors import RunFailed
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, ENCODER, check_key_prefix
from lapwing.cosim.transport.session_settings import mesh
from lapwing.runs.multi_process_run import Clock
from lapwing.runs.observer import Elapsed, Observer
from lapwing.services import process_table
from lapwing.services.process_main import ProcessSpec
from lapwing.services.security import settings

LOST = 6.0  # [s] without a message after which a run counts as lost: TCP retries up to 4 s after a 2 s interruption
GRACE = 2.0  # [s] largest difference of the delays of two links
JOIN_TIMEOUT = 120.0  # [s] until all services have joined
CLOSE_TIMEOUT = 5.0  # [s] for the recorder to close its log after a failure
CONFIRMED = 60.0  # [s] without a message after the end until a participant counts as stalled


def monitor_run(
    spec: ProcessSpec, observer: Observer, live: Callable[[RunMonitor], None] = lambda watch: None
) -> Elapsed:
    """Monitor a run whose services are started separately to its end; `live` is called about five times a second.

    Raises:
        RunFailed: a service does not join, or leaves before the end.
        ValueError: invalid key prefix, or the certificate cannot be used.
        Interrupted: ended by a signal.
    """
    config, peers, key_prefix = spec.config, spec.peers, spec.key_prefix
    check_key_prefix(key_prefix)
    external = spec.external or {}
    names = set(process_table.required_processes(config, external))
    clock, participants = Clock(observer, config, names), PublisherIds(key_prefix, external=tuple(external))
    listen, connect = mesh(MONITOR, peers)
    gid, security = participants.gid(MONITOR), settings(config, MONITOR, key_prefix, spec.keys)
    with Stop() as stop, ZenohBus(listen, connect, gid=gid, security=security) as bus:
        watch = RunMonitor(bus, participants, peers, LOST, config.services)
        leave = bus.declare_liveliness(f"{key_prefix}/{ALIVE_KEY}/{MONITOR}")
        try:
            _follow(watch, clock, stop, names, live)
        except RunFailed:
            leave()  # makes the other participants end
            deadline = time.monotonic() + CLOSE_TIMEOUT
            while names <= watch.present and process_table.RECORDER not in watch.left and time.monotonic() < deadline:
                watch.poll(0.2)
            raise
    return clock.elapsed


def _follow(watch: RunMonitor, clock: Clock, stop: Stop, names: set[str], live: Callable[[RunMonitor], None]) -> None:
    """Monitor the run of the participants `names` to its end. See `monitor_run` for errors."""
    deadline = time.monotonic() + JOIN_TIMEOUT
    while not (watch.ended and process_table.RECORDER in watch.left):
        live(watch)
        watch.poll(0.2)
        clock.observe(watch)
        stop.check()
        if not names <= watch.present:
            watch.last_news = time.monotonic()
            if time.monotonic() > deadline:
                raise RunFailed(f"no participant {', '.join(sorted(names - watch.present))} within {JOIN_TIMEOUT:g} s")
        elif not watch.ended and watch.left & names and not _becomes_true(watch, lambda: watch.ended, GRACE):
            raise RunFailed(f"{', '.join(sorted(watch.left))}: left the run at t = {watch.time_ns * 1e-9:.3f} s")
        elif watch.start is None and time.monotonic() < deadline:
            watch.last_news = time.monotonic()  # comparing run configurations takes time over a slow network
        elif culprit := watch.stall_message(names):
            raise RunFailed(culprit)
        elif watch.ended and time.monotonic() - watch.last_news > CONFIRMED:
            silent = sorted(names - watch.left - watch.confirmed) or [process_table.RECORDER]
            raise RunFailed(f"{', '.join(silent)}: did not end within {CONFIRMED:g} s of the last news")
    # After a cut, links recover one by one; the clock owner stays until its outcome is confirmed
    others = names - {process_table.RECORDER}
    _becomes_true(watch, lambda: watch.outcome is not None or bool(watch.left & others), LOST)
    live(watch)
    _becomes_true(watch, lambda: watch.present <= watch.left | watch.confirmed, LOST)  # viewers have the last events
    if early := watch.abort_message():
        raise RunFailed(early)


def _becomes_true(watch: RunMonitor, condition: Callable[[], bool], seconds: float) -> bool:
    """Poll until `condition` is true, for at most `seconds`. Return its value."""
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        watch.poll(0.2)
    return condition()


def parse_endpoints(text: str) -> dict[str, str]:
    """Return "name=endpoint,..." as a table, external services first: all others connect to them.

    Raises:
        ValueError: the text does not have this form, or an endpoint is invalid.
    """
    peers = dict(pair.split("=", 1) for pair in text.split(",") if "=" in pair)
    if not peers or len(peers) != len(text.split(",")):
        raise ValueError(f"--endpoints {text}: expected name=endpoint,..., for example plant=tcp/plant:7447")
    for endpoint in peers.values():
        check_endpoint("--endpoints", endpoint)
    return {**external_services(peers), **peers}


def check_complete(peers: Mapping[str, str], required: Iterable[str]) -> None:
    """Raise ValueError, with the missing names, if a required participant has no endpoint."""
    if missing := [name for name in required if name not in peers]:
        raise ValueError(f"--endpoints: no endpoint for {', '.join(missing)}")


def external_services(peers: Mapping[str, str]) -> dict[str, str]:
    """Return the external services of a table: those with a separate process that encodes their messages."""
    return {name: endpoint for name, endpoint in peers.items() if f"{name}{ENCODER}" in peers}


def parse_external(texts: Iterable[str], config: RunConfig) -> dict[str, str]:
    """Return each "name=endpoint" as a table.

    Raises:
        ValueError: a text does not have this form, or names a service that cannot be external.
    """
    result = {}
    for text in texts:
        name, _, endpoint = text.partition("=")
        choices = [service for service in config.services if service != process_table.CLOCK_OWNER]
        if name not in choices:
            raise ValueError(f"--external {text}: expected NAME=ENDPOINT with one of {', '.join(choices)}")
        check_endpoint(f"--external {name}", endpoint)
        result[name] = endpoint
    return result


def check_endpoint(option: str, text: str) -> None:
    """Raise ValueError unless the text is protocol/address:port, or the path of a Unix-domain socket."""
    if not re.fullmatch(r"(tcp|udp|tls|quic|ws)/[^/\s]+:\d+|unixsock-stream/\S+", text):
        raise ValueError(f"{option} {text}: expected an endpoint protocol/address:port, for example tcp/127.0.0.1:7447")

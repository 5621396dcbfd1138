"""One run of a scene, in processes, joined to processes elsewhere, or in this process; the log is what remains."""

import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from messages.topics import POSE, STATUS, Topic
from services.bus import ZenohBus, mesh
from services.launcher import WATCHER, RunFailed, Watch, check_space, key_space, launch
from services.log import LogWriter
from services.outside import Operator, nobody
from services.process import ALIVE_KEY
from services.progress import Display
from services.provenance import attachments, metadata
from services.scene import Scene
from services.sections import Exchange, Vehicle
from services.single import run_single
from services.table import RECORDER, ROUTER, lockstep_services

JOIN_TIMEOUT = 120.0  # [s] the services elsewhere get to appear
SLOW = 2.0  # [s] of preparing after which the user is told why


class Interrupted(BaseException):
    """The user ended the run; `signal` is how. Like KeyboardInterrupt, no `except Exception` holds it up."""

    def __init__(self, number: int):
        super().__init__(f"ended by {signal.Signals(number).name}")
        self.signal = number


class Stop:
    """Remembers SIGINT and SIGTERM while it is entered."""

    def __init__(self) -> None:
        self.number: int | None = None

    def __enter__(self) -> "Stop":
        self._before = {n: signal.signal(n, self._note) for n in (signal.SIGINT, signal.SIGTERM)}
        return self

    def _note(self, number: int, _: object) -> None:
        self.number = number

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def check(self) -> None:
        """Raise `Interrupted` when a signal has come."""
        if self.number is not None:
            raise Interrupted(self.number)


AGAIN = 0.5  # [s]


def end_at_once() -> None:
    """Let SIGINT and SIGTERM raise `Interrupted` wherever the program is; a flight has its gentler `Stop`."""

    def raise_(number: int, _: object) -> None:
        # An exception that is raised inside a call from the compiler's library is lost there: raise it again, later.
        signal.signal(signal.SIGALRM, lambda *_: raise_(number, None))
        signal.setitimer(signal.ITIMER_REAL, AGAIN)
        raise Interrupted(number)

    def lost(fault: Any) -> None:
        if not isinstance(fault.exc_value, Interrupted):
            sys.__unraisablehook__(fault)

    sys.unraisablehook = lost
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, raise_)


def prepare(scene: Scene, say: Callable[[str], None]) -> None:
    """Compile the kernels of a scene's services or load them, once, before several processes would do so at a time."""
    notice = threading.Timer(SLOW, say, ["compiling kernels (first run only) ..."])
    notice.daemon = True
    notice.start()
    try:
        for service in lockstep_services(scene).values():
            service.prepare()
    finally:
        notice.cancel()


def fly_processes(
    scene: Scene,
    command: Callable[[str], list[str]],
    space: str,
    display: Display,
    door: bool,
    beside: Iterable[str] = (),
) -> tuple[float, float]:
    """Fly with every service in a process of its own; (simulated, wall) seconds.

    Args:
        scene: what to fly.
        command: the arguments of `lapwing` that start a service.
        space: the key space.
        display: shows how far it is, and at the end what the services beside had to say.
        door: whether there is a router.
        beside: services without which the flight goes on.

    Raises:
        RunFailed: a service died or froze.
        SpaceInUse: another run uses this key space.
        Interrupted: ended by a signal.
    """
    clock = _Clock(scene, space, display)
    with key_space(space), Stop() as stop:
        names = [*lockstep_services(scene), RECORDER, *([ROUTER] if door else [])]
        ended = lambda watch: clock.observe(watch) or stop.number is not None  # noqa: E731
        for name, words in launch(names, command, space, clock.topics, ended, beside).items():
            for line in words.splitlines():
                display.say(f"{name}: {line}")
        stop.check()
    return clock.simulated, clock.wall


def fly_joined(scene: Scene, peers: dict[str, str], space: str, display: Display) -> tuple[float, float]:
    """Watch a run whose services are started elsewhere, to its end; (simulated, wall) seconds.

    Raises:
        RunFailed: a service does not come, or is gone before the end.
        ValueError: not a key space.
        Interrupted: ended by a signal.
    """
    check_space(space)
    clock = _Clock(scene, space, display)
    names = {*lockstep_services(scene), RECORDER}
    listen, connect = mesh(WATCHER, peers)
    with Stop() as stop, ZenohBus(listen, connect) as bus:
        watch = Watch(bus, space, clock.topics)
        bus.declare_alive(f"{space}/{ALIVE_KEY}/{WATCHER}")
        deadline = time.monotonic() + JOIN_TIMEOUT
        while not (watch.ended and RECORDER in watch.gone):
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
    return clock.simulated, clock.wall


def fly_single(
    scene: Scene,
    log: Path,
    speed: float | None,
    display: Display,
    operator: Operator = nobody,
    last: int | None = None,
) -> tuple[float, float]:
    """Fly with all services in this process; (simulated, wall) seconds.

    Args:
        scene: what to fly.
        log: where to record it.
        speed: simulated seconds per second, None for as fast as it goes.
        display: shows how far the run is.
        operator: who gives commands, where the scene listens to them.
        last: the tick after which to stop, None for the end of the run.

    Raises:
        Interrupted: ended by a signal.
    """
    services = lockstep_services(scene)
    for service in services.values():
        service.prepare()
    simulated = 0

    with Stop() as stop, LogWriter(log, metadata(scene, "single"), attachments(scene)) as writer:

        def observe(time_ns: int, newest: dict[Topic, bytes]) -> bool:
            nonlocal simulated
            simulated = time_ns
            display.show(time_ns, newest.get(POSE), newest.get(STATUS))
            return stop.number is not None

        display.begin()
        started = time.perf_counter()
        run_single(scene, services, writer, speed, observe, operator, last)
        wall = time.perf_counter() - started
        stop.check()
    return simulated * 1e-9, wall


class _Clock:
    """Follows a run for the display, and measures it from its first message to its last."""

    def __init__(self, scene: Scene, space: str, display: Display):
        vehicle = scene[Vehicle].name
        self.topics = [topic.zenoh_key(vehicle, space) for topic in (POSE, STATUS)]
        self._display = display
        self._began = False
        self.simulated = self.wall = 0.0

    def observe(self, watch: Watch) -> bool:
        """Show what is new; never asks to stop."""
        if not watch.newest:
            return False
        if not self._began:
            self._began = True
            self._display.begin()
        self.simulated, self.wall = watch.time_ns * 1e-9, watch.wall
        self._display.show(watch.time_ns, *[watch.newest.get(key, (0, None))[1] for key in self.topics])
        return False


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


def check_endpoint(option: str, text: str) -> None:
    """Refuse what is no Zenoh endpoint.

    Raises:
        ValueError: not of the form protocol/address:port.
    """
    if not re.fullmatch(r"(tcp|udp|tls|quic|ws)/[^/\s]+:\d+", text):
        raise ValueError(f"{option} {text}: expected an endpoint protocol/address:port, for example tcp/127.0.0.1:7447")


def shared_core(scene: Scene) -> int | None:
    """The core for all services of a sequential lock step, in which only one works at a time; None: leave it free."""
    if scene[Exchange].coupling != "sequential" or not hasattr(os, "sched_getaffinity"):
        return None
    cores = sorted(os.sched_getaffinity(0))
    return cores[os.getpid() % len(cores)]


def scene_arguments(path: Path, overrides: Iterable[str]) -> list[str]:
    """The arguments that make another process read the same scene."""
    return [str(path), *[part for override in overrides for part in ("--set", override)]]

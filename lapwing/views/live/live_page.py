"""Browser page that shows a run live, at an unguessable local address."""

import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Self
from urllib.parse import parse_qs

import numpy as np

from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.diagram.multi_vehicle import members
from lapwing.cosim.processes.run_monitor import MONITOR, RunMonitor
from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_events import Event
from lapwing.flights.flight_provenance import Origin
from lapwing.flights.topic_view import TopicView
from lapwing.messages import OperatorCommand, OperatorInput, header
from lapwing.services.common.operator_inbox import OPERATOR_KEY, accepts_commands
from lapwing.views.report.style import COLOURS, FLOWN
from lapwing.views.view3d.bodies import LEVEL
from lapwing.views.view3d.live_trail import LiveTrail
from lapwing.views.view3d.local_server import run_server
from lapwing.views.view3d.recording import with_bridge
from lapwing.views.view3d.samples import Samples, sample
from lapwing.views.view3d.scans import BUDGET
from lapwing.views.view3d.stage import Vehicle, add_shaders
from lapwing.views.view3d.surroundings import add_surroundings
from lapwing.views.view3d.vehicle_bodies import motion

FRAMES = 8  # frames of a step, shown evenly until the next step
LINES = 200  # lines of events
LAG = (0.02, 0.5)  # [s] shortest and longest time over which a step is spread
ERROR = 0.25  # [m] upper end of the trail's colour scale
SIZE = 1.0  # [m] size that sets the camera's distance
SOURCE = "view"  # of the commands from the page
COMMANDS = ("manual", "arm", "position_control", "takeoff", "land", "return")
FLUSH_TIME = 0.3  # [s] time for browsers to receive the last frame


class LivePage:
    """Server of the 3D view of a run; a context manager that closes the sockets at its end.

    Attributes:
        operated: names of the vehicles that accept commands.
    """

    def __init__(self, config: RunConfig):
        """Open the page before the run begins."""
        token = secrets.token_urlsafe(16)
        names = list(config.vehicles)
        colours = [COLOURS[i % len(COLOURS)] for i in range(len(names))] if len(names) > 1 else [FLOWN]
        facts = {"names": names, "colours": colours, "size": SIZE, "start": 0.0, "error": ERROR, "live": True}
        self.operated = [member.vehicle for member in members(config) if accepts_commands(member)]
        facts["sticks"] = self.operated
        self._operate: Callable[[int, bytes], None] | None = None  # publishes an OperatorInput during the flight
        self._count = 0  # of commands
        self._colours = colours
        self._stack = ExitStack()
        server = run_server(token, partial(with_bridge, facts=facts), self._take_sticks)
        self._server = self._stack.enter_context(server)
        self.address = f"http://127.0.0.1:{self._server.get_port()}/{token}/"
        add_surroundings(self._server.scene, _before_start(members(config)[0]))
        add_shaders(self._server.scene)
        self._vehicles: list[Vehicle] = []
        self._trails: list[LiveTrail] = []
        self._frames: deque[tuple[float, list[Samples], int]] = deque()  # wall time [s], samples, index
        self._ready, self._over, self._before = threading.Condition(), False, time.monotonic()
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.set_panel_label(config.scene)
        self._time = gui.add_text("time", "waiting for the flight", disabled=True)
        self._events = gui.add_text("events", "", multiline=True, disabled=True)
        self._player = threading.Thread(target=self._play, daemon=True)
        self._player.start()

    def show(self, steps: Sequence[FlightData], events: Sequence[list[Event]]) -> None:
        """Show the new steps and events of every vehicle."""
        if not self._vehicles:
            for k, (step, colour) in enumerate(zip(steps, self._colours, strict=True)):
                several = len(steps) > 1
                self._vehicles.append(Vehicle(self._server.scene, k, step, step.vehicle, colour, named=several))
                self._trails.append(LiveTrail(self._vehicles[-1], ERROR))
        now = time.monotonic()
        spread, self._before = float(np.clip(now - self._before, *LAG)), now
        first, last = (float(steps[0].truth.times[k]) for k in (0, -1))
        times = np.linspace(first, last, FRAMES + 1)[1:]
        result = [sample(step, motion(step), times, BUDGET) for step in steps]
        with self._ready:
            self._frames.extend((now + spread * k / FRAMES, result, k) for k in range(FRAMES))
            self._ready.notify()
        with self._server.atomic():
            for trail, step in zip(self._trails, steps, strict=True):
                trail.extend(step)
            self._show_events(steps, events)

    def follow(self, watch: RunMonitor) -> None:
        """Send the commands of the page to this run from its first step to its end."""
        flies = watch.time_ns > 0 and not watch.complete  # before it kernels compile: the commands would wait
        self._operate = partial(watch.publish, f"{OPERATOR_KEY}/{MONITOR}") if flies else None

    def _take_sticks(self, query: str) -> bool:
        """Publish the command of a request of the page; return False if it is invalid."""
        fields = parse_qs(query)
        try:
            (vehicle,), (kind,) = fields["vehicle"], fields["kind"]
            numbers = tuple(float(text) for values in fields.get("values", []) for text in values.split(","))
        except (KeyError, ValueError):
            return False
        if vehicle not in self.operated or kind not in COMMANDS or len(numbers) != (4 if kind == "manual" else 0):
            return False
        self._count += 1
        command = OperatorCommand(kind, SOURCE, self._count, numbers)
        if self._operate:
            self._operate(0, OperatorInput(header(0, vehicle), (command,)).encode())
        return True

    def _show_events(self, steps: Sequence[FlightData], events: Sequence[list[Event]]) -> None:
        several = len(steps) > 1
        lines = [
            f"{event.time:8.2f}  {f'{step.vehicle}  ' if several else ''}{event.kind}  {event.text}"
            for step, happened in zip(steps, events, strict=True)
            for event in happened
        ]
        if lines:
            known = self._events.value.splitlines()
            self._events.value = "\n".join([*sorted(lines, reverse=True), *known][:LINES])

    def _play(self) -> None:
        """Show each frame at its time, until the end."""
        while True:
            with self._ready:
                while not self._frames and not self._over:
                    self._ready.wait()
                if not self._frames:
                    return
                due, result, k = self._frames.popleft()
                late = len(self._frames) > 4 * FRAMES
            if not late:
                time.sleep(max(0.0, due - time.monotonic()) if not self._over else 0.0)
            with self._server.atomic():
                for vehicle, samples in zip(self._vehicles, result, strict=True):
                    vehicle.show(samples, k)
                self._time.value = f"{result[0].times[k]:.2f} s"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        with self._ready:
            self._over = True
            self._ready.notify()
        self._player.join(FLUSH_TIME)
        self._time.value = f"{self._time.value}, the flight is over"
        if self._server.get_clients():
            self._server.flush()
            time.sleep(FLUSH_TIME)
        self._stack.close()


def _before_start(config: RunConfig) -> FlightData:
    """Return a flight of one sample, at the start [m]."""
    place = Origin.of_config(config).scene.get("vehicle", {}).get("initial_position") or (0.0, 0.0)
    columns = {"pose.position": np.array([[*place[:2], 0.0]]), "pose.orientation": np.array([LEVEL])}
    return FlightData({"ground_truth": TopicView(np.zeros(1, np.int64), columns)}, Origin.of_config(config))

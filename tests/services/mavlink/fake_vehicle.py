"""Vehicle with the autopilot's side of the interface; it moves as a point mass and needs no kernels.

It serves to prove the link: that clients which we did not write can say what they want, and hear what became of it.
"""

import math
import socket
import threading
import time
from contextlib import contextmanager

from lapwing.messages import (
    CommandAck,
    CommandAcks,
    Estimate,
    OperatorInput,
    Point,
    Pose,
    Quaternion,
    Status,
    Vector3,
    header,
)
from lapwing.messages.topics import COMMAND_ACKS, ESTIMATE, STATUS
from lapwing.services.common.autopilot_parameters import Parameter
from lapwing.services.mavlink.link_server import LinkServer, Options
from lapwing.services.mavlink.resolve import describe
from lapwing.services.scene_resolver import load

PERIOD = 0.02  # [s] simulated
SPEED = 8.0  # [m/s]
NEAR = 0.3  # [m]
NONE = 65535


PARAMETERS = (
    Parameter("MIS_TAKEOFF_ALT", "m", 2.5, 0.5, 100.0, ""),
    Parameter("MPC_XY_P", "1/s", 0.95, -100.0, 100.0, ""),
    Parameter("SYS_FAILURE_EN", "", 1.0, 0.0, 1.0, "", True),
    Parameter("NAV_DLL_ACT", "", 2.0, 0.0, 3.0, "", True),
    *[
        Parameter(name, "", value, 0.0, 5.0, "", True)
        for name, value in (
            *(("FS_FENCE_ACT", 2.0), ("FS_BAT_CRIT_ACT", 2.0)),
            *(("FS_BAT_EMER_ACT", 3.0), ("FS_MOTOR_ACT", 3.0)),
        )
    ],
    *[Parameter(f"FILL_{k}", "", float(k), 0.0, 100.0, "") for k in range(40)],
)


class FakeVehicle:
    """Fake vehicle: input are commands; outputs are estimate, status and acknowledgements."""

    def __init__(self):
        self.time_ns = 0
        self.position, self.velocity, self.yaw = [0.0, 0.0, 0.0], (0.0, 0.0, 0.0), 0.0
        self.mode, self.armed, self.landed = "hold", False, True
        self.target = None
        self.parameters = {p.name: p.default for p in PARAMETERS}
        self.limits = {p.name: p for p in PARAMETERS}
        self.items, self.current, self.reached, self.state = (), 0, NONE, 1
        self.fences, self.rally = (), ()
        self.setpoint = self.stick = None
        self.setpoint_at = -1e9
        self.commands, self.answers, self.text, self.arming_blockers = [], [], [], ()
        self.unanswered = set()  # kinds that are not acknowledged
        self.status, self.more = {}, []  # other fields of the status, and other messages
        self.kinds = {}
        self.rejected = ()  # sources that the estimator rejects

    @property
    def seconds(self):
        return self.time_ns * 1e-9

    def operate(self, payload):
        self.commands += OperatorInput.decode(payload).commands

    def messages(self):
        """Run one step. Return the (topic, message) pairs."""
        self.time_ns += round(PERIOD * 1e9)
        for command in self.commands:
            self.kinds[command.kind] = command
            if command.kind not in self.unanswered:
                self.answers.append(self.handle(command))
        self.commands = []
        self.fly()
        head = header(self.time_ns, "world")
        half = 0.5 * self.yaw
        pose = Pose(Point(*self.position), Quaternion(0.0, 0.0, math.sin(half), math.cos(half)))
        status = Status(
            head, self.mode, self.mode, self.armed, self.landed, False, "", self.current, len(self.items), self.reached,
            self.state, self.has_setpoint, self.arming_blockers, False,
        )  # fmt: skip
        yield STATUS, status._replace(**self.status)
        yield from self.more
        yield COMMAND_ACKS, CommandAcks(head, tuple(self.answers), tuple(self.text))
        yield ESTIMATE, Estimate(head, pose, Vector3(*self.velocity), rejected_sources=self.rejected)
        self.answers, self.text = [], []

    @property
    def has_setpoint(self):
        return self.seconds - self.setpoint_at < 1.0

    def handle(self, c):
        done = getattr(self, f"do_{c.kind}", self.enter)(c)
        result, value = done if isinstance(done, tuple) else (done or 0, 0.0)
        return CommandAck(c.source, c.id, result, 0.0, "", value)

    def enter(self, c):
        if not self.armed:
            return 1
        self.mode, self.target = c.kind, None

    def do_link(self, c):
        return 0

    def do_arm(self, c):
        if self.arming_blockers and not c.values[0]:
            self.text += [f"cannot arm: {reason}" for reason in self.arming_blockers]
            return 1
        self.armed = True

    def do_disarm(self, c):
        if not self.landed and not c.values[0]:
            return 2
        self.armed = False

    def do_takeoff(self, c):
        if not self.armed:
            return 1
        up = self.parameters["MIS_TAKEOFF_ALT"] if math.isnan(c.values[0]) else c.values[0]
        self.mode, self.landed = "takeoff", False
        self.target = [*self.position[:2], up]

    def do_return(self, c):
        self.mode, self.target = "return", [0.0, 0.0, 0.0]

    def do_goto(self, c):
        if not self.armed:
            return 1
        self.mode, self.target = "goto", list(c.values[:3])

    def do_mission_upload(self, c):
        self.items, self.current, self.reached, self.state = c.items, 0, NONE, 2 if c.items else 1

    def do_fence_upload(self, c):
        self.fences = c.items

    def do_rally_upload(self, c):
        self.rally = c.items

    def do_mission(self, c):
        if not self.items or not self.armed:
            return 1
        self.mode, self.state, self.landed = "mission", 3, False

    def do_mission_start(self, c):
        self.armed = True
        return self.do_mission(c)

    def do_mission_current(self, c):
        if not 0 <= c.values[0] < len(self.items):
            return 2
        self.current = int(c.values[0])

    def do_speed(self, c):
        return 0

    def do_offboard(self, c):
        if not self.has_setpoint:
            self.text.append("offboard refused: no setpoints")
            return 2
        self.mode, self.landed = "offboard", False

    def do_offboard_position(self, c):
        self.setpoint, self.setpoint_at = c.values, self.seconds

    def do_offboard_attitude(self, c):
        self.setpoint, self.setpoint_at = c.values, self.seconds

    def do_manual(self, c):
        self.stick = c.values

    def do_position_control(self, c):
        self.mode = "position_control"

    def do_parameter(self, c):
        p = self.limits[c.text]
        if not p.least <= c.values[0] <= p.most:
            return 2, self.parameters[c.text]
        self.parameters[c.text] = c.values[0]
        return 0, c.values[0]

    def fly(self):
        """Move towards the target, or follow the setpoint."""
        self.velocity = (0.0, 0.0, 0.0)
        if not self.armed:
            return
        if self.mode == "land":
            self.target = [*self.position[:2], 0.0]
        if self.mode == "mission":
            self.follow()
        if self.mode == "offboard" and len(self.setpoint) == 11:
            if all(map(math.isfinite, self.setpoint[:3])):
                self.target = list(self.setpoint[:3])
            elif all(map(math.isfinite, self.setpoint[3:6])):
                self.velocity, self.target = self.setpoint[3:6], None
        if self.mode == "position_control" and self.stick:
            self.velocity, self.target = tuple(3.0 * s for s in self.stick[:3]), None
        if self.target:
            gap = [t - p for t, p in zip(self.target, self.position, strict=True)]
            speed = min(SPEED, math.hypot(*gap) / PERIOD)
            self.velocity = tuple(speed * g / max(1e-9, math.hypot(*gap)) for g in gap)
            if math.hypot(*gap) < NEAR:
                self.arrive()
        self.position = [p + v * PERIOD for p, v in zip(self.position, self.velocity, strict=True)]

    def arrive(self):
        if self.mode in ("land", "return"):
            self.armed, self.landed, self.mode = False, True, "hold"
        elif self.mode == "takeoff":
            self.mode = "hold"

    def follow(self):
        if self.current >= len(self.items):
            self.state, self.mode = 5, "hold"
            return
        item = self.items[self.current]
        places = {"waypoint": item.position, "takeoff": Vector3(*self.position[:2], item.position.z)}
        place = places.get(item.action)
        if place and math.dist(place, self.position) > NEAR:
            self.target = list(place)
            return
        self.reached = self.current
        self.current = min(self.current + 1, len(self.items) - 1)
        if self.reached == len(self.items) - 1:
            self.state, self.mode = 5, "hold"


def free_port(kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Running:
    """Fake vehicle with its links in a separate thread."""

    def __init__(self, *urls, speed=1.0, overrides=(), **options):
        self.vehicle = FakeVehicle()
        scene = load("lapwing/scenes/hover.toml", overrides)
        description = describe(scene)._replace(parameters=PARAMETERS)
        self.hub = LinkServer(description, Options(urls, speed=speed, **options), self.vehicle.operate)
        self._speed, self._over = speed, False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def counts(self):
        return self.hub.adapter.counts

    def _run(self):
        due = time.monotonic()
        while not self._over:
            while (left := due - time.monotonic()) > 0.0:
                self.hub.wait(left)
            self.hub.wait(0.0)
            for topic, message in self.vehicle.messages():
                self.hub.handle(topic, self.vehicle.time_ns, message.encode())
            due += PERIOD / self._speed

    def end(self):
        self._over = True
        self._thread.join(10.0)
        self.hub.close()


@contextmanager
def flying(*urls, **more):
    running = Running(*urls, **more)
    try:
        yield running
    finally:
        running.end()


def until(condition, seconds=10.0):
    """Wait for a condition. Return True if it holds."""
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    return bool(condition())

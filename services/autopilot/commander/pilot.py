"""The state machine between the operator and the controller: armed or not, flying or not, and in which mode.

Deterministic: it knows the ticks, the estimate, the operator's recorded commands, and nothing else. Every time-out
counts simulation time.
"""

import math
from typing import Any

from dynamics.lie.quaternion import to_roll_pitch_yaw
from dynamics.vector import ZERO, Vec3
from messages import Answer
from services.autopilot.commander import checks, failsafes
from services.autopilot.commander.fence import Fence
from services.autopilot.commander.guide import Guide, Limits
from services.autopilot.commander.modes import modes
from services.autopilot.commander.modes.base import FlightMode
from services.autopilot.commander.route import ACTIVE, COMPLETE, MISSING, PAUSED, WAITING, Route
from services.autopilot.estimator import SOURCES
from services.autopilot.estimator.state import GPS
from services.autopilot.interface import Setpoint
from services.parameters import Parameter

PHASES = "mission"  # how the flight along the scene's own trajectory is called
FELT = 1.0  # [s] of sinking in vain after which the vehicle stands on the ground
LIGHT = 0.5  # share of the hovering thrust below which it does not carry itself
STILL = 0.15  # [m/s]
STICK_TIMEOUT = 1.0  # [s] older sticks are in the middle
POSITION_LOST = 64 | 128 | 1 << GPS  # bits of the estimate's health


def followed(message: Any) -> Setpoint:
    """The setpoint of a message."""
    m = message
    return Setpoint(tuple(m.position), tuple(m.velocity), tuple(m.acceleration), m.yaw, m.yaw_rate)


class Pilot:
    """What the vehicle is asked to do, from tick to tick."""

    def __init__(
        self,
        table: dict[str, Parameter],
        ground: float,
        gravity: float,
        hover_share: float,
        trajectory: bool,
        operator: bool,
    ):
        """A pilot of a vehicle that stands on the ground, disarmed.

        Args:
            table: the parameters.
            ground: world z of the standing vehicle [m].
            gravity: [m/s^2].
            hover_share: thrust of hovering over the greatest thrust.
            trajectory: whether it begins along the scene's own trajectory.
            operator: whether somebody may give commands.
        """
        self.table = table
        self.parameters: dict[str, float] = {p.name: p.default for p in table.values()}
        self.ground, self.gravity, self.hover_share = ground, gravity, hover_share
        self.operated: bool = operator
        self.home = (0.0, 0.0)
        self.estimate: Any = None
        self.health: int = 0
        self.refusing: list[float] = [0.0] * len(SOURCES)  # how long each source has been lost or refused [s]
        self.charge: float = math.nan  # of the battery, fraction; NaN: nobody knows
        self.failed_motor: int = 0  # its number, from 1; 0: none
        self.mode_name: str = PHASES if trajectory else "hold"
        self.mode: FlightMode | None = None if trajectory else modes()["hold"].Mode(self)
        self.guide = Guide((0.0, 0.0, ground), 0.0)
        self.armed = self.flying = self.flown = False
        self.speed = math.nan  # [m/s] asked for in this flight
        self.route = Route()
        self.fence: Fence = Fence()
        self.rally: tuple[Vec3, ...] = ()
        self.offboard: tuple[str, tuple[float, ...]] = ("", ())
        self.offboard_age: float = math.inf  # [s]
        self.sticks: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)  # forward, left, up, yaw rate, each from -1 to 1
        self.sticks_age: float = math.inf  # [s]
        self.link_age: float = math.inf  # [s]
        self.linked: bool = False  # a ground station has been heard
        self.failsafe = ""  # the reason of the failsafe in force
        self.last_flight = False  # the run is over with the next disarming
        self.answers: list[Answer] = []
        self.texts: list[str] = []
        self.waiting_arm: tuple[Any, float] | None = None  # command that waits for the checks, and its patience [s]
        self.parameters_changed = False
        self._direct: Setpoint | None = None
        self._idle = self._sinking = 0.0  # [s]
        self._failsafes = failsafes.Failsafes()

    # What the modes see.

    @property
    def limits(self) -> Limits:
        """How the setpoint may move now."""
        p = self.parameters
        wanted = p["MPC_XY_CRUISE"] if math.isnan(self.speed) else self.speed
        return Limits(
            min(wanted, p["MPC_XY_VEL_MAX"]),
            p["MPC_Z_VEL_MAX_UP"],
            p["MPC_Z_VEL_MAX_DN"],
            p["MPC_ACC_HOR"],
            p["MPC_JERK_AUTO"],
            p["MPC_YAW_RATE"],
        )

    @property
    def offboard_fresh(self) -> bool:
        """Whether setpoints from outside are coming."""
        return self.offboard_age < self.parameters["COM_OF_LOSS_T"]

    @property
    def sticks_fresh(self) -> bool:
        """Whether somebody holds a joystick."""
        return self.sticks_age < STICK_TIMEOUT

    @property
    def position_lost(self) -> bool:
        """Whether the estimate is not to be trusted as to where the vehicle is."""
        return bool(self.health & POSITION_LOST)

    @property
    def battery_warning(self) -> int:
        """0: none, 1: low, 2: critical, 3: nearly empty."""
        return sum(self.charge < self.parameters[name] for name in ("BAT_LOW_THR", "BAT_CRIT_THR", "BAT_EMERGEN_THR"))

    @property
    def on_trajectory(self) -> bool:
        """Whether the vehicle follows the scene's own trajectory."""
        return self.mode is None

    @property
    def looks_closely(self) -> bool:
        """Whether the setpoint was made from the estimate, which must then be that of the same tick."""
        return self._direct is not None

    def lift_off(self) -> None:
        """Let the guide leave the ground, from where the vehicle is believed to stand."""
        if not self.flying and self.armed:
            x, y, _ = self.estimate.position_world
            self.guide = Guide((x, y, self.ground), to_roll_pitch_yaw(self.estimate.attitude)[2])
            self.flying = self.flown = True

    def follow(self, setpoint: Setpoint) -> None:
        """Hand this setpoint to the controller for one tick, past the guide, which goes along."""
        self._direct = setpoint
        self.guide = Guide(setpoint.position_world, setpoint.yaw, setpoint.velocity_world)

    # What changes its state.

    def look(self, estimate: Any, dt: float) -> None:
        """Take in an estimate, dt [s] after the one before."""
        self.estimate, self.health = estimate, estimate.health
        self.refusing = [t + dt if self.health >> bit & 1 else 0.0 for bit, t in enumerate(self.refusing)]

    def say(self, text: str) -> None:
        """Tell the pilot on the ground."""
        self.texts.append(text)

    def enter(self, name: str, *values: float) -> None:
        """Go to another mode; ValueError says why that cannot be."""
        kind = modes()[name].Mode
        if kind.needs_flight and not self.flying:
            raise ValueError(f"{name}: the vehicle does not fly")
        self.mode, self.mode_name = kind(self, *values), name

    def arm(self) -> None:
        """Motors ready; home is here."""
        self.armed, self.flown, self._idle = True, False, 0.0
        x, y, _ = self.estimate.position_world
        self.home = (x, y)
        self.say("armed")

    def disarm(self, why: str) -> None:
        """Motors off, wherever it is."""
        self.armed = self.flying = False
        self.failsafe, self.speed = "", math.nan
        self._failsafes = failsafes.Failsafes()
        if self.mode_name != "hold":
            self.enter("hold")
        self.say(f"disarmed: {why}")

    def step(self, dt: float, setpoint: Any, thrust: float, cut: bool) -> Setpoint:
        """What the controller is to follow for a tick of dt [s].

        Args:
            dt: length of the tick.
            setpoint: of the scene's trajectory, None without one.
            thrust: that the controller asked for at the last tick, over that of hovering.
            cut: the controller has cut the motors off on the ground.
        """
        self.offboard_age += dt
        self.link_age += dt
        self.sticks_age += dt
        if self.waiting_arm is not None:
            self._try_again(dt)
        if self.on_trajectory:
            given = followed(setpoint)
            self.flying = self.armed = thrust > 0.0 and not cut
            if self.flying:
                self.guide = Guide(given.position_world, given.yaw, given.velocity_world)
                self._failsafes.watch(self, dt)
            if self.on_trajectory:
                return given
            self.flown = True
        elif self.flying:
            self._failsafes.watch(self, dt)
        if self.flying:
            self._feel(dt, thrust, cut)
        self._count_down(dt)
        self._direct = None
        mode = self.mode
        assert mode is not None
        mode.step(self, dt)
        if mode.next and mode is self.mode:
            self.enter(mode.next)
        if self._direct is not None:
            return self._direct
        x, y, _ = self.guide.position
        return self.guide.setpoint if self.flying else Setpoint((x, y, self.ground), ZERO, ZERO, self.guide.yaw, 0.0)

    def _feel(self, dt: float, thrust: float, cut: bool) -> None:
        """Notice the ground: the controller did, or the vehicle does not sink although nothing carries it."""
        vain = self.guide.velocity[2] < -0.2 and abs(self.estimate.velocity_world[2]) < STILL and thrust < LIGHT
        self._sinking = self._sinking + dt if vain else 0.0
        if cut or self._sinking > FELT:
            self.flying, self._idle, self._sinking = False, 0.0, 0.0
            self.say("landed")

    def _count_down(self, dt: float) -> None:
        """Disarm what stands armed for long."""
        self._idle = self._idle + dt if self.armed and not self.flying else 0.0
        patience = self.parameters["COM_DISARM_LAND" if self.flown else "COM_DISARM_PRFLT"]
        if 0.0 < patience < self._idle:
            self.disarm("landed" if self.flown else "nobody took off")

    def _try_again(self, dt: float) -> None:
        """Arm once the checks allow it, as long as the command's patience lasts."""
        assert self.waiting_arm is not None
        command, patience = self.waiting_arm
        reasons = checks.reasons(self)
        if not reasons:
            self.waiting_arm = None
            self.arm()
            self.answer(command, Answer.ACCEPTED)
        elif patience < dt:
            self.waiting_arm = None
            self.answer(command, Answer.TEMPORARILY_REJECTED, reasons[0])
        else:
            self.waiting_arm = command, patience - dt

    def answer(self, command: Any, result: int, text: str = "", value: float = 0.0) -> None:
        """Tell whoever gave a command what became of it."""
        self.answers.append(Answer(command.source, command.id, result, float(result == 0), text, value))

    # What it tells.

    @property
    def phase(self) -> str:
        """Name of the present part of the flight."""
        return self.mode.phase if self.mode else ""

    @property
    def finished(self) -> bool:
        """Whether the run is over: the last flight has ended in a disarming."""
        return not self.on_trajectory and self.flown and not self.armed and (self.last_flight or not self.operated)

    @property
    def mission_state(self) -> int:
        """As MAVLink's MISSION_STATE numbers it."""
        if not self.route.items:
            return MISSING
        if self.route.item is None:
            return COMPLETE
        if self.mode_name == "mission" and self.armed and not self.on_trajectory:
            return ACTIVE
        return PAUSED if self.flying or self.route.current > 0 else WAITING

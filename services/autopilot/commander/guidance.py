"""Guidance: the part of the commander's state that flight modes read and change."""

from dataclasses import dataclass, field

from lapwing.dynamics.lie.quaternion import to_roll_pitch_yaw
from lapwing.dynamics.vector import Vec3, subtract
from lapwing.kernels import math
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.route import Route
from lapwing.services.autopilot.commander.smoothing import Limits, PositionSmoothing
from lapwing.services.common.plans.fence import Fence
from lapwing.services.common.ports import Setpoint

STICK_DEADZONE = 0.05
GRIPPER = "PD_GRIPPER_EN"
_WITHOUT_STICKS = (0, 4)  # COM_RC_IN_MODE: radio only, disabled


@dataclass
class OperatorInputs:
    """Operator streams and their ages [s]."""

    sticks: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)  # forward, left, up, yaw rate, each from -1 to 1
    sticks_age: float = math.inf
    offboard_kind: str = ""  # offboard_position, offboard_attitude or offboard_motors
    offboard_rejection: str = ""  # reason for rejecting the last setpoint; "": accepted
    offboard: tuple[float, ...] = ()
    offboard_age: float = math.inf
    link_age: float = math.inf
    linked: bool = False  # a ground station has connected

    def age(self, dt: float) -> None:
        """Add dt [s] to all ages."""
        self.offboard_age += dt
        self.link_age += dt
        self.sticks_age += dt


TOO_FAR, TOO_HIGH = "too far from home", "too high above home"  # places that the maximum distances forbid


@dataclass
class Guidance:
    """Setpoint, route, fence and operator inputs."""

    parameters: dict[str, float]  # values by name
    smoothing: PositionSmoothing
    armed: bool = False
    flying: bool = False
    has_flown: bool = False  # since it was armed
    speed: float = math.nan  # [m/s] for this flight; NaN: the parameter's
    home: Vec3 = (0.0, 0.0, 0.0)  # [m] world x, y and ground height, of the arming position or set by command
    roi: Vec3 | None = None  # [m] region of interest, towards which the vehicle yaws
    released: bool = False  # open the gripper
    finish_requested: bool = False  # the next disarming ends the run: no operator waits
    route: Route = field(default_factory=Route)
    fence: Fence = field(default_factory=Fence)
    rally_points: tuple[Vec3, ...] = ()
    inputs: OperatorInputs = field(default_factory=OperatorInputs)

    @property
    def limits(self) -> Limits:
        """Limits of the setpoint."""
        p = self.parameters
        desired = p["MPC_XY_CRUISE"] if math.isnan(self.speed) else self.speed
        return Limits(
            min(desired, p["MPC_XY_VEL_MAX"]),
            p["MPC_Z_VEL_MAX_UP"],
            p["MPC_Z_VEL_MAX_DN"],
            p["MPC_ACC_HOR"],
            p["MPC_JERK_AUTO"],
            math.radians(p["MPC_YAWRAUTO_MAX"]),
        )

    @property
    def yaw_tolerance(self) -> float:
        """Heading error [rad] at which a heading counts as reached."""
        return math.radians(self.parameters["MIS_YAW_ERR"])

    @property
    def manual_limits(self) -> Limits:
        """Limits of the setpoint under manual control."""
        return self.limits._replace(yaw_rate=math.radians(self.parameters["MPC_MAN_Y_MAX"]))

    @property
    def manual_tilt(self) -> float:
        """Tilt [rad] at full stick."""
        return math.radians(min(self.parameters["MPC_MAN_TILT_MAX"], self.parameters["MPC_TILTMAX_AIR"]))

    def above_home(self, constants: Constants, parameter: str) -> float:
        """Return world z [m] of an altitude parameter above home."""
        return self.home[2] + constants.resting_height + self.parameters[parameter]

    def words(self, constants: Constants, position: Vec3) -> str:
        """Return a position from home in words: "10 m north, 5 m up"."""
        east, north, up = subtract(position, (*self.home[:2], self.home[2] + constants.resting_height))
        named = ((north, "north", "south"), (east, "east", "west"), (up, "up", "down"))
        parts = [f"{abs(way):.3g} m {there if way > 0.0 else back}" for way, there, back in named if abs(way) >= 0.05]
        return ", ".join(parts) or "home"

    @property
    def home_distances(self) -> tuple[float, float]:
        """Maximum horizontal and vertical distance from home [m]; 0: unlimited."""
        p = self.parameters
        return p.get("GF_MAX_HOR_DIST", 0.0), p.get("GF_MAX_VER_DIST", 0.0)  # not in logs of former versions

    def breach(self, constants: Constants, position_world: Vec3) -> str:
        """Return the breach of the distances from home or of the fence by a position [m], "" if there is none."""
        (x, y, z), (horizontal, vertical) = position_world, self.home_distances
        if 0.0 < horizontal <= math.dist((x, y), self.home[:2]):
            return TOO_FAR
        if 0.0 < vertical <= z - constants.resting_height - self.home[2]:
            return TOO_HIGH
        return self.fence.breach(x, y)

    @property
    def first_place_limit(self) -> float:
        """Maximum distance of a mission's first position from the start [m]; 0 or less: unlimited."""
        return self.parameters.get("MIS_DIST_1WP", 0.0)  # not in logs of former versions

    @property
    def offboard_available(self) -> bool:
        """True if offboard setpoints are recent."""
        return self.inputs.offboard_age < self.parameters["COM_OF_LOSS_T"]

    @property
    def has_gripper(self) -> bool:
        """True if the gripper is enabled."""
        return self.parameters.get(GRIPPER, 1.0) != 0.0  # not in logs of former versions

    @property
    def uses_sticks(self) -> bool:
        """True if stick positions are used."""
        return self.parameters.get("COM_RC_IN_MODE", 1.0) not in _WITHOUT_STICKS  # not in logs of former versions

    @property
    def sticks_fresh(self) -> bool:
        """True if stick positions are recent."""
        return self.inputs.sticks_age < self.parameters.get("COM_RC_LOSS_T", 1.0)  # not in logs of former versions

    def stick(self, index: int) -> float:
        """Return a stick position, -1 to 1; 0 within the dead zone or without recent sticks."""
        deflection = self.inputs.sticks[index]
        return deflection if self.sticks_fresh and abs(deflection) >= STICK_DEADZONE else 0.0

    def lift_off(self, constants: Constants, view: CommanderInput) -> None:
        """Start the flight at the estimated position if armed and on the ground."""
        if not self.flying and self.armed:
            x, y, _ = view.estimate.position_world
            yaw = to_roll_pitch_yaw(view.estimate.attitude)[2]
            self.smoothing = PositionSmoothing((x, y, constants.resting_height), yaw)
            self.flying = self.has_flown = True

    def follow(self, setpoint: Setpoint) -> None:
        """Continue from a setpoint that was not smoothed."""
        self.smoothing = PositionSmoothing(setpoint.position_world, setpoint.yaw, setpoint.velocity_world)

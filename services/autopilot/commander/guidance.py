"""Guidance: what the flight modes see and change of what the commander remembers."""

import math
from dataclasses import dataclass, field

from lapwing.dynamics.lie.quaternion import to_roll_pitch_yaw
from lapwing.dynamics.vector import Vec3
from lapwing.services.autopilot.commander.commander_input import CommanderInput, Constants
from lapwing.services.autopilot.commander.fence import Fence
from lapwing.services.autopilot.commander.route import Route
from lapwing.services.autopilot.commander.smoothing import Limits, PositionSmoothing
from lapwing.services.autopilot.interface import Setpoint

STICK_TIMEOUT = 1.0  # [s] older sticks are in the middle
STICK_DEADZONE = 0.05  # sticks nearer to the middle ask for nothing


@dataclass
class OperatorInputs:
    """The streams of an operator, and how old they are [s]."""

    sticks: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)  # forward, left, up, yaw rate, each from -1 to 1
    sticks_age: float = math.inf
    offboard_kind: str = ""  # offboard_position, offboard_attitude or offboard_motors
    offboard_refused: str = ""  # why the last setpoint was not taken; "": it was
    offboard: tuple[float, ...] = ()
    offboard_age: float = math.inf
    link_age: float = math.inf
    linked: bool = False  # a ground station has been heard

    def age(self, dt: float) -> None:
        """Let dt [s] pass; what has never come stays infinitely old."""
        self.offboard_age += dt
        self.link_age += dt
        self.sticks_age += dt

    @property
    def sticks_fresh(self) -> bool:
        """Whether somebody holds a joystick."""
        return self.sticks_age < STICK_TIMEOUT

    def stick(self, index: int) -> float:
        """Where a stick is, -1 to 1; in the middle where it is nearly there, or nobody holds it."""
        deflection = self.sticks[index]
        return deflection if self.sticks_fresh and abs(deflection) >= STICK_DEADZONE else 0.0


@dataclass
class Guidance:
    """Where the setpoint is and what it is to do."""

    parameters: dict[str, float]  # values by name
    smoothing: PositionSmoothing
    armed: bool = False
    flying: bool = False
    has_flown: bool = False  # since it was armed
    speed: float = math.nan  # asked for in this flight; NaN: the parameter's [m/s]
    home: Vec3 = (0.0, 0.0, 0.0)  # world x, y and the height of the ground where it was armed, or was told to be [m]
    roi: Vec3 | None = None  # region of interest: where the nose points on its way [m]
    released: bool = False  # the gripper is to be open
    route: Route = field(default_factory=Route)
    fence: Fence = field(default_factory=Fence)
    rally_points: tuple[Vec3, ...] = ()
    inputs: OperatorInputs = field(default_factory=OperatorInputs)

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
            math.radians(p["MPC_YAWRAUTO_MAX"]),
        )

    @property
    def yaw_tolerance(self) -> float:
        """Error [rad] within which a heading that was asked for is reached."""
        return math.radians(self.parameters["MIS_YAW_ERR"])

    @property
    def manual_limits(self) -> Limits:
        """As `limits`, under the sticks."""
        return self.limits._replace(yaw_rate=math.radians(self.parameters["MPC_MAN_Y_MAX"]))

    @property
    def manual_tilt(self) -> float:
        """Tilt [rad] that a full stick asks for."""
        return math.radians(min(self.parameters["MPC_MAN_TILT_MAX"], self.parameters["MPC_TILTMAX_AIR"]))

    def above_home(self, constants: Constants, parameter: str) -> float:
        """World z [m] of an altitude above home, which is where the vehicle stands."""
        return self.home[2] + constants.resting_height + self.parameters[parameter]

    @property
    def offboard_fresh(self) -> bool:
        """Whether setpoints from outside are coming."""
        return self.inputs.offboard_age < self.parameters["COM_OF_LOSS_T"]

    def lift_off(self, constants: Constants, view: CommanderInput) -> None:
        """Let the setpoint leave the ground, from where the vehicle is by the estimate, if it is armed."""
        if not self.flying and self.armed:
            x, y, _ = view.estimate.position_world
            yaw = to_roll_pitch_yaw(view.estimate.attitude)[2]
            self.smoothing = PositionSmoothing((x, y, constants.resting_height), yaw)
            self.flying = self.has_flown = True

    def follow(self, setpoint: Setpoint) -> None:
        """Go on from a setpoint that was not smoothed."""
        self.smoothing = PositionSmoothing(setpoint.position_world, setpoint.yaw, setpoint.velocity_world)

"""The `[autopilot]` table of a scene: gains, estimator, controller, operator."""

from typing import Any, ClassVar, Literal

from pydantic import Field

from lapwing.cosim.scene import Files, Scene
from lapwing.cosim.scene.files import merge_tables, unvalidated_value
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import Table
from lapwing.kernels import math
from lapwing.services.autopilot.controller_parameters import Airframe, build, hover_thrust, hover_torque
from lapwing.services.autopilot.gains import FOLDER, GainSet
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.autopilot.parameter_file import parse
from lapwing.services.common import autopilot_parameters as parameters
from lapwing.services.common import ports, user_code, user_modules
from lapwing.services.common.firmware.schema import FIRMWARES, FirmwareKeys, is_foreign
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import Effects, airframe

ESTIMATORS = ("kalman", "ground_truth")
NEEDED = ("imu", "magnetometer", "gps")  # sensors that the filter needs to start
DOWN = -90.0  # [deg] elevation of a vertical ray
WEAKEST_FIELD = 1e-6  # [T] horizontal; at 5e-6 T aviation calls compasses unreliable

Option = bool | int | float | str | list[float]


def distance_sensor(scene: Scene) -> str | None:
    """Return the port of the sonar, or of a rangefinder that points straight down. Return None without either."""
    installed = scene.tables("sensors")
    if ports.SONAR in installed:
        return ports.SONAR
    points_down = ports.RANGEFINDER in installed and scene.lookup("sensors.rangefinder.elevation_deg") == DOWN
    return ports.RANGEFINDER if points_down else None


class LandingTable(Table):
    """Thresholds for stopping the motors (theory, section 4.5).

    With `cut_height` they stop at once below that height, as in the paper. Otherwise they stop after contact with the
    ground: on the way down, with a low thrust, at rest vertically, and held up by more than the rotors, for a time.
    """

    cut_height: float = Field(default=0.0, ge=0.0, le=1.0)  # [m] above the resting height; 0: contact is detected
    thrust: float = Field(default=0.75, gt=0.0, lt=1.0)  # of the hover thrust, above which there is no contact
    ground_force: float = Field(default=0.25, gt=0.0, lt=1.0)  # of the weight, the least force of the ground
    vertical_speed: float = Field(default=0.2, gt=0.0, le=1.0)  # [m/s] above which there is no contact
    hold_time: float = Field(default=0.1, gt=0.0, le=5.0)  # [s] of contact before the motors ramp down
    ramp_time: float = Field(default=0.6, gt=0.0, le=5.0)  # [s] from 60 % of the thrust command to none


class Autopilot(FirmwareKeys):
    """The autopilot."""

    TABLE: ClassVar[str] = "autopilot"
    OPTIONAL: ClassVar[bool] = True
    gains: str = "tuned"  # name of a shipped set or one in gains/ next to the scene, or path of a .toml file
    estimator: str = "kalman"  # the Kalman filter; "ground_truth": the true state; or "module:Name" of a user's class
    estimator_options: dict[str, Option] = Field(default_factory=dict)  # options of its constructor
    expected_wind_speed: float = Field(default=10.0, ge=0, le=30)  # [m/s] expected by the Kalman filter
    attitude_error: Literal["euler", "so3"] = "euler"  # Euler angles, as in the paper, or SO(3)
    controller: str | None = None  # "module:Name" of a user's class; default: cascaded PID
    controller_options: dict[str, Option] = Field(default_factory=dict)  # options of its constructor
    accept_commands: bool = False  # accept commands of an operator
    follow_trajectory: bool = True  # follow the scene's [trajectory]; false: start disarmed and wait for commands
    landing: LandingTable = LandingTable()
    parameters: dict[str, float] = Field(default_factory=dict)  # values by name, or path of a parameter file

    @classmethod
    def embed(cls, tree: dict[str, Any], files: Files) -> None:
        """Read the gain set into the table `gains`, a parameter file into its values, and store user modules."""
        if is_foreign(tree):
            cls.embed_parameters(tree, files)
            return
        if isinstance(name := unvalidated_value(tree, cls.TABLE, "gains", cls.model_fields["gains"].default), str):
            path = files.find("autopilot.gains", "gain set", name, "gains", FOLDER)
            content = files.toml(GainSet.TABLE, "autopilot.gains", path)
            tree[GainSet.TABLE] = merge_tables(content, tree.get(GainSet.TABLE, {}))
        for key in ("controller", "estimator"):
            code, where = unvalidated_value(tree, cls.TABLE, key), f"{cls.TABLE}.{key}"
            if key == "estimator" and isinstance(code, str) and ":" not in code:
                if code not in ESTIMATORS:
                    raise ConfigError.unknown(where, "estimator", code, (*ESTIMATORS, "module:Name"))
            elif isinstance(code, str) and (module := user_code.split_reference(where, code)[0]) != user_code.MEMORY:
                user_modules.embed(tree, files, where, module)
        if isinstance(file := unvalidated_value(tree, cls.TABLE, "parameters"), str):
            path = files.path("autopilot.parameters", file)
            text = files.text("autopilot.parameters", "autopilot.parameters", path)
            tree[cls.TABLE]["parameters"] = parse(text, path)

    def check(self, scene: Scene) -> None:
        """Raise ConfigError if parameters are invalid, the vehicle cannot hover, or a sensor is missing."""
        if self.firmware in FIRMWARES:
            return
        self.check_own()
        parameters.table(scene)
        if not self.follow_trajectory and not self.accept_commands:
            message = "false leaves no source of setpoints; set accept_commands = true too"
            raise ConfigError("autopilot.follow_trajectory", message)
        frame = known_airframe(scene)
        try:
            build(scene[GainSet].plain(), frame)
        except ConfigError:
            raise
        except ValueError as error:
            raise ConfigError("airframe", str(error)) from None
        _check_motor_limits(scene, frame)
        for key, unused in (("controller", self.controller is None), ("estimator", self.estimator in ESTIMATORS)):
            if unused and getattr(self, f"{key}_options"):
                raise ConfigError(f"autopilot.{key}_options", "is not used", f'autopilot.{key} = "module:Name" too')
        if self.estimator == "kalman":
            missing = [f"[sensors.{name}]" for name in NEEDED if name not in scene.tables("sensors")]
            if missing:
                raise ConfigError(
                    "autopilot.estimator", f'"kalman" needs {", ".join(missing)}; add them or use "ground_truth"'
                )
            horizontal = math.hypot(*environment(scene).magnetic_field_world[:2])
            if horizontal < WEAKEST_FIELD:
                message = f"got {horizontal:.1g} T horizontally, too little for the estimator's heading"
                raise ConfigError("environment.magnetic_field", message, f"at least {WEAKEST_FIELD:g} T")
            reference = int(self.parameters.get("EKF2_HGT_REF", parameters.GPS_HEIGHT))
            sensor = parameters.HEIGHT_SENSORS[reference]
            required = distance_sensor(scene) if reference == parameters.SONAR_HEIGHT else sensor
            if required not in scene.tables("sensors"):
                message = f"{reference} needs a sensor that the vehicle does not have"
                raise ConfigError("autopilot.parameters.EKF2_HGT_REF", message, f"[sensors.{sensor}] too")


def _check_motor_limits(scene: Scene, known: Airframe) -> None:
    """Check current, power and voltage of a motor in hover if `dc_motor` is active (theory, eq. (2.9)).

    Raises:
        ConfigError: a limit is exceeded.
    """
    if "dc_motor" not in scene[Effects].tables:
        return
    frame = airframe(scene)
    motor, constant = frame.motor, frame.motor.rotor_constant
    speed = math.sqrt(hover_thrust(known) / known.motor.thrust_coefficient)
    current = hover_torque(known) / (motor.belt_efficiency * constant) + motor.no_load_current
    voltage = constant * speed + (motor.resistance + motor.esc_resistance) * current
    for needed, limit, unit in (
        (current, frame.motor_current_limit, "A"),
        (current * voltage, motor.power_limit, "W"),
        (voltage, motor.max_voltage, "V"),
    ):
        if needed >= limit:
            message = f"hovering needs {needed:.1f} {unit} per motor, the limit is {limit:.1f} {unit}"
            raise ConfigError(
                "airframe.motor", message, "a lighter vehicle, or higher limits of motor, ESC and battery"
            )

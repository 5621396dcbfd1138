"""The `[autopilot]` of a scene: gains, what the controller flies on, and the attitude loop."""

from typing import ClassVar, Literal

from pydantic import Field

from services import parameters
from services.autopilot.gains import GainSet, load
from services.parameter_file import read
from services.scene import Scene, Section
from services.sections import airframe

NEEDED = ("imu", "magnetometer", "gps")  # sensors without which the estimator cannot start


class Autopilot(Section):
    """How the vehicle is flown."""

    TABLE: ClassVar[str] = "autopilot"
    OPTIONAL: ClassVar[bool] = True
    gains: str = "tuned"  # a gain set of services/autopilot/gains, or the path of a .toml file beside the scene
    estimator: Literal["sensors", "truth"] = "sensors"
    attitude: Literal["angles", "so3"] = "angles"  # the paper's error angle by angle, or the geometric one
    operator: bool = False  # whether commands from outside are listened to
    trajectory: bool = True  # follow the scene's [trajectory]; false: stand disarmed and wait for commands
    parameters: dict[str, float] | str = Field(default_factory=dict)  # by name, or a file of them beside the scene

    def gain_set(self, scene: Scene) -> GainSet:
        """The gain set that the scene names; ValueError if there is none."""
        name = str(scene.path.parent / self.gains) if self.gains.endswith(".toml") else self.gains
        return load(name)

    def given_parameters(self, scene: Scene) -> dict[str, float]:
        """The values that the scene sets; ValueError if its file of them cannot be read."""
        given = self.parameters
        return read(scene.path.parent / given) if isinstance(given, str) else given

    def check(self, scene: Scene) -> None:
        """The gain set is there, the vehicle suits the controller, and the sensors that it needs are carried."""
        try:
            self.gain_set(scene)
        except ValueError as error:
            raise ValueError(f"gains: {error}") from None
        try:
            parameters.table(scene)
        except ValueError as error:
            raise ValueError(f"parameters: {error}") from None
        if not self.trajectory and not self.operator:
            raise ValueError("trajectory: false leaves nobody to say what to fly; set operator = true too")
        if (n := len(airframe(scene).rotors.position)) != 4:
            raise ValueError(f"gains: the controller flies vehicles of 4 rotors, this airframe has {n}")
        if self.estimator == "sensors":
            missing = [name for name in NEEDED if name not in scene.tables("sensors")]
            if missing:
                raise ValueError(
                    f'estimator: "sensors" needs {", ".join(f"[sensors.{n}]" for n in missing)}, or say "truth"'
                )

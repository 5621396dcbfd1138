"""Gain sets: one TOML file each in `gains/`, or anywhere by its path; validated, then put on an airframe."""

import tomllib
from pathlib import Path
from typing import Annotated, ClassVar

from annotated_types import Gt, Lt
from pydantic import ConfigDict, Field, ValidationError

from lapwing.cosim.scene import SceneTable
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import fault
from lapwing.services.autopilot.controller_parameters import Gains

FOLDER = Path(__file__).parent / "gains"
Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[Finite, Gt(0.0)]
Triple = tuple[Finite, Finite, Finite]  # P, I, D


class GainSet(SceneTable):
    """A gain set as its file writes it: P, I, D of each loop; outputs of altitude, yaw and the inner loops are the
    force demand of every rotor [N], those of the outer loops are tilts [rad]."""

    TABLE: ClassVar[str] = "gains"
    OPTIONAL: ClassVar[bool] = True
    FROM_FILE: ClassVar[bool] = True
    model_config = ConfigDict(strict=False)

    description: str  # one line
    altitude: Triple  # [N/m], [N/(m s)], [N s/m] altitude
    yaw: Triple  # [N/rad], [N/(rad s)], [N s/rad] heading
    roll_inner: Triple  # [N/rad], [N/(rad s)], [N s/rad] of tilt to the left, minus the roll: negative
    pitch_inner: Triple  # [N/rad], [N/(rad s)], [N s/rad] pitch
    roll_outer: Triple  # [rad/m], [rad/(m s)], [rad s/m] position along y
    pitch_outer: Triple  # [rad/m], [rad/(m s)], [rad s/m] position along x
    tilt_limit: Annotated[Positive, Lt(1.4)]  # [rad] largest roll and pitch reference
    reference_bandwidth: Positive  # [rad/s] of the tilt references' filter
    reference_damping: Positive  # ratio, of the tilt references' filter
    feed_forward: bool  # weight, tilt, setpoint acceleration, and the torque that the tilt references need

    def plain(self) -> Gains:
        """The gains as a NamedTuple of numbers, as the control law takes them."""
        return Gains(*(getattr(self, name) for name in Gains._fields))


def names() -> list[str]:
    """The gain sets that ship."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load(name: str) -> GainSet:
    """The gain set of a name, or of a path that ends in .toml.

    Raises ValueError (one line) for an unknown name (lists the choices), a file that cannot be read, a wrong content.
    """
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    if path.parent == FOLDER and path.stem not in names():
        raise ConfigError.unknown("", "gain set", name, names())
    try:
        return GainSet.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read ({error.strerror})") from None
    except ValidationError as error:
        raise ValueError(f"{path}: {fault(error, GainSet)}") from None
    except ValueError as error:  # TOML or UTF-8
        raise ValueError(f"{path}: not valid TOML: {error}") from None

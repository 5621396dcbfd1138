"""Gain sets: TOML files in `gains/` or at a path."""

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
    """A gain set with P, I, D of each loop. Altitude, yaw and inner loops output a force per rotor [N], outer loops a
    tilt [rad]."""

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
    tilt_limit: Annotated[Positive, Lt(1.4)]  # [rad] maximum roll and pitch reference
    reference_bandwidth: Positive  # [rad/s] of the tilt references' filter
    reference_damping: Positive  # ratio, of the tilt references' filter
    feed_forward: bool  # weight, tilt, setpoint acceleration, and torque of the tilt references

    def plain(self) -> Gains:
        """Return the numbers for the control law."""
        return Gains(*(getattr(self, name) for name in Gains._fields))


def names() -> list[str]:
    """Return the names of the shipped gain sets."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load(name: str) -> GainSet:
    """Return the gain set of a name, or of a path that ends in .toml.

    Raises:
        ValueError: (one line) the name is unknown, or the file is unreadable or invalid.
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

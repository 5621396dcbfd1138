"""Scene tables that several services read."""

import importlib.resources
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

import lapwing.scenes
from lapwing.cosim.scene import Files, Scene, SceneTable

SHIPPED = Path(str(importlib.resources.files(lapwing.scenes)))  # folder of the scenes that ship
Triple = Annotated[tuple[float, float, float], Field(strict=False)]  # along x, y, z; TOML gives a list

Pair = Annotated[tuple[float, float], Field(strict=False)]  # along x and y


class Run(SceneTable):
    """Duration, pace and random seed of a run."""

    TABLE: ClassVar[str] = "run"
    SHARED: ClassVar[bool] = True
    title: str = ""  # one line for `lapwing scenes`
    seed: int = Field(default=1, ge=0, lt=2**63)  # seed of all random numbers; equal seeds give bit-for-bit equal runs
    duration: float = Field(gt=0.0, le=1e6)  # [s] latest end of the run
    stop_delay: float = Field(default=1.0, ge=0.0)  # [s] from the end of the mission to the end of the run
    real_time_factor: float | None = Field(default=None, gt=0.0)  # simulated over wall time; unset: unlimited


def title(scene: Path) -> str:
    """Return the title in a scene's file without validating the other keys.

    Raises:
        SceneError: the file is not TOML.
    """
    run = Files(scene.parent).toml("scene", "scene", scene).get(Run.TABLE, {})
    return str(run.get("title", "")) if isinstance(run, dict) else ""


class CooperativeLoad(SceneTable):
    """Quadrotors that carry a point mass by rigid links (theory, section 7.4); tuples have an entry for each."""

    TABLE: ClassVar[str] = "cooperative_load"
    OPTIONAL: ClassVar[bool] = True
    quad_mass: tuple[float, ...] = Field(min_length=2, strict=False)  # [kg] of each quadrotor
    quad_inertia: tuple[Triple, ...] = Field(min_length=2, strict=False)  # [kg m^2] principal moments
    link_length: tuple[float, ...] = Field(min_length=2, strict=False)  # [m] of each link
    link_start: tuple[Triple, ...] = Field(min_length=2, strict=False)  # unit vectors from quadrotor to load
    load_mass: float  # [kg] of the load
    load_start: Triple  # [m] world frame
    load_velocity_start: Triple = (0.0, 0.0, 0.0)  # [m/s] world frame
    gravity: float = 9.81  # [m/s^2] acceleration of free fall


class Published(SceneTable):
    """Published figures to compare the run with."""

    TABLE: ClassVar[str] = "published"
    source: str = "published"  # origin of the figures
    airframe: str = ""  # for which they hold; empty: any
    rmse: dict[Literal["x", "y", "z", "roll", "pitch", "yaw"], float] = Field(default_factory=dict)  # [m], [rad] error


def published_figures(resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Return the `[published]` table of a resolved scene; {} if it flies another airframe than that of the figures."""
    figures = resolved.get(Published.TABLE, {})
    airframe = figures.get("airframe", "")
    return figures if airframe in ("", resolved.get("vehicle", {}).get("airframe")) else {}


def follows_trajectory(scene: Scene) -> bool:
    """Return True if the vehicle follows the scene's `[trajectory]` rather than operator commands."""
    return scene.has("trajectory") and not (scene.has("autopilot") and not scene.lookup("autopilot.follow_trajectory"))

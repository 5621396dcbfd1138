"""Arguments and options that several commands share; commands with one frozen options value."""

import inspect
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="scene file (TOML), or name of a shipped scene")]
LogFile = Annotated[Path, typer.Argument(metavar="FILE", help="MCAP log of a run")]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="override a scene key, e.g. solver.step=0.001 (repeatable)"),
]
KeyPrefix = Annotated[str, typer.Option(metavar="NAME", help="prefix of the run's Zenoh keys")]
Speed = Annotated[str | None, typer.Option(metavar="1|N|max", help="simulated seconds per second; max: unlimited")]
Keys = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="folder made by `lapwing certificates`, for endpoints tls/HOST:PORT"),
]
PlanFiles = Annotated[
    list[str] | None,
    typer.Option(
        "--plan",
        metavar="[NAME=]FILE",
        help="mission file (.plan, .waypoints) to fly instead of the scene's trajectory; NAME selects the vehicle",
    ),
]


def with_options(command: Callable[[Any], None]) -> Callable[..., None]:
    """Turn a function of one options dataclass into a command with an option for each field.

    The fields of the class itself come first in the help, those of its bases after them.
    """
    (parameter,) = inspect.signature(command).parameters.values()
    kind = parameter.annotation
    hints = get_type_hints(kind, include_extras=True)
    defaults = {
        field.name: inspect.Parameter.empty if field.default is MISSING else field.default for field in fields(kind)
    }
    names = dict.fromkeys(name for cls in kind.__mro__ for name in inspect.get_annotations(cls))

    @wraps(command)
    def from_options(**values: Any) -> None:
        command(kind(**values))

    from_options.__annotations__ = {name: hints[name] for name in names}
    from_options.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=defaults[name], annotation=hints[name])
            for name in names
        ]
    )
    del from_options.__wrapped__  # type: ignore[attr-defined]  # Typer would read its signature
    return from_options


@dataclass(frozen=True, kw_only=True)
class LinkOptions:
    """Links to ground stations, viewers and ROS 2 nodes."""

    mavlink: Annotated[
        list[str] | None,
        typer.Option(metavar="URL", help="MAVLink link to ground stations, e.g. udpout:127.0.0.1:14550 (repeatable)"),
    ] = None
    mavlink_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="passphrase file: sign MAVLink, and reject unsigned commands")
    ] = None
    foxglove: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="serve live data to Foxglove on this address, e.g. 127.0.0.1:8765"),
    ] = None
    ros2: Annotated[
        int | None, typer.Option(metavar="DOMAIN", min=0, max=232, help="join this ROS 2 domain (rmw_zenoh)")
    ] = None
    ros2_router: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Zenoh router of the ROS 2 domain [127.0.0.1:7447]")
    ] = None
    insecure: Annotated[
        bool,
        typer.Option(
            "--insecure", help="allow unauthenticated links: unsigned MAVLink, Zenoh without --keys, remote viewers"
        ),
    ] = False

    def validate_links(self) -> None:
        """Raise ValueError for links that cannot be opened, or are not authenticated without --insecure."""
        if self.mavlink_key and not self.mavlink:
            raise ValueError("--mavlink-key: expected with --mavlink URL")
        if self.mavlink:
            from lapwing.services.mavlink.links import check
            from lapwing.services.mavlink.signing import read_key

            for url in self.mavlink:
                check(url)
            if self.mavlink_key:
                read_key(self.mavlink_key)
        if self.foxglove is not None:
            from lapwing.services.foxglove.server import check_address

            check_address(self.foxglove, self.insecure)
        if self.ros2 is not None:
            from lapwing.services.ros2.node import parse_router

            parse_router(self.router, self.insecure)
        elif self.ros2_router is not None:
            raise ValueError(f"--ros2-router {self.ros2_router}: expected with --ros2 DOMAIN")

    @property
    def router(self) -> str:
        """HOST:PORT of the ROS 2 router, "" without ROS 2."""
        if self.ros2 is None:
            return ""
        from lapwing.services.ros2.node import ROUTER

        return self.ros2_router or ROUTER

    @property
    def spec(self) -> dict[str, Any]:
        """The link fields of a `ProcessSpec`."""
        return {
            "mavlink": tuple(self.mavlink or ()),
            "mavlink_key": absolute(self.mavlink_key),
            "insecure": self.insecure,
            "foxglove": self.foxglove or "",
            "ros2": self.ros2,
            "ros2_router": self.router,
        }


def absolute(path: Path | None) -> str:
    """Return an absolute path as text, "" for None."""
    return str(path.absolute()) if path else ""


LONGEST_TICK = 1.0  # [s] of wall time; services without a message for 2.5 s count as stalled


def check_pace(source: str, speed: float | None, interval: float) -> None:
    """Raise ValueError if a tick takes so long that the services of a run would count as stalled.

    Args:
        source: option or key that sets the speed, with its value.
        speed: simulated seconds per second, None for unlimited.
        interval: [s] simulated time of a tick.
    """
    if speed is not None and interval > LONGEST_TICK * speed:
        raise ValueError(
            f"{source}: a tick of {interval:g} s would take over {LONGEST_TICK:g} s; expected at least"
            f" {interval / LONGEST_TICK:g}, or a higher communication.rate"
        )


def parse_speed(text: str | None) -> float | None:
    """Return simulated seconds per second, None for unlimited.

    Raises:
        ValueError: not a positive number and not "max".
    """
    if text is None or text == "max":
        return None
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise ValueError(f"--speed {text}: expected a number above 0, or max")
    return value

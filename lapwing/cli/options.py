"""Arguments and options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

SceneFile = Annotated[
    Path, typer.Argument(metavar="SCENE", help="a scene file (TOML), or the name of a scene that ships")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="override a key of the scene: solver.step=0.001 (repeatable)"),
]
KeyPrefix = Annotated[str, typer.Option(metavar="NAME", help="key prefix of the run on the bus")]
Speed = Annotated[
    str | None, typer.Option(metavar="1|N|max", help="simulated seconds per second; max: as fast as it goes")
]
Peers = Annotated[
    str | None,
    typer.Option(metavar="TABLE", help="name=endpoint,... of all participants, when they are started separately"),
]
MavlinkUrls = Annotated[
    list[str] | None,
    typer.Option("--mavlink", metavar="URL", help="a link to ground stations: udpout:127.0.0.1:14550 (repeatable)"),
]
MavlinkKey = Annotated[
    Path | None,
    typer.Option("--mavlink-key", metavar="FILE", help="a passphrase: sign, and take only what is signed with it"),
]
Insecure = Annotated[
    bool,
    typer.Option(
        "--insecure",
        help="links whose other end proves nothing: unsigned MAVLink, Zenoh without --keys, viewers elsewhere",
    ),
]
Keys = Annotated[
    Path | None, typer.Option(metavar="FOLDER", help="certificates of `lapwing keys`, for endpoints tls/HOST:PORT")
]
FoxgloveAddress = Annotated[
    str | None,
    typer.Option("--foxglove", metavar="HOST:PORT", help="let Foxglove or Lichtblick look on: 127.0.0.1:8765"),
]
Ros2Domain = Annotated[
    int | None,
    typer.Option("--ros2", metavar="DOMAIN", min=0, max=232, help="be a node for ROS 2 (rmw_zenoh), ROS_DOMAIN_ID"),
]
Ros2Router = Annotated[
    str | None, typer.Option("--ros2-router", metavar="HOST:PORT", help="its Zenoh router [127.0.0.1:7447]")
]
PlanFiles = Annotated[
    list[str] | None,
    typer.Option(
        "--plan",
        metavar="[NAME=]FILE",
        help="fly this mission (.plan, .waypoints) instead of the scene's trajectory; of several vehicles, NAME",
    ),
]


def parse_speed(text: str | None) -> float | None:
    """Simulated seconds per second, None for as fast as it goes.

    Raises:
        ValueError: no positive number and not "max".
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

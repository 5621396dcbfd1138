"""`lapwing schema` and `lapwing certificates`."""

import json
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.output_paths import claim
from lapwing.cosim.complete_file import write_text


class Kind(Enum):
    """Kind of TOML file."""

    scene = "scene"
    airframe = "airframe"
    gains = "gains"


@app.command()
def schema(
    kind: Annotated[Kind, typer.Argument(metavar="KIND", help="kind of file")] = Kind.scene,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="output file [standard output]")] = None,
) -> None:
    """Write a JSON schema with which editors check TOML files."""
    from lapwing.file_schemas.json_schema import SCHEMAS

    text = json.dumps(SCHEMAS[kind.value](), indent=1) + "\n"
    if out is None:
        typer.echo(text, nl=False)
    else:
        claim(out)
        write_text(out, text)


@app.command()
def certificates(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="folder to create")],
    days: Annotated[int, typer.Option(metavar="N", min=1, max=3650, help="validity [days]")] = 365,
) -> None:
    """Create TLS certificates for runs on several hosts.

    Writes a certificate for each service and a read-only one for viewers to FOLDER.
    """
    from lapwing.cosim.access.certificates import make
    from lapwing.cosim.access.zenoh_access import VIEWER
    from lapwing.services.security import names

    holders = [*names(), VIEWER]
    make(folder, holders, days)
    typer.echo(f"{folder}: certificates of {', '.join(holders)}; copy to each host only its own; do not commit them")

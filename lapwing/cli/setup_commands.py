"""`lapwing schema` and `lapwing certificates`."""

import json
from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.output_paths import check_not_dash, claim
from lapwing.cosim.complete_file import write_text
from lapwing.dynamics.config_error import ConfigError


@app.command()
def schema(
    kind: Annotated[str, typer.Argument(metavar="KIND", help="kind of file: scene, airframe or gains")] = "scene",
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="output file [standard output]")] = None,
) -> None:
    """Write a JSON schema with which editors check TOML files."""
    from lapwing.file_schemas.json_schema import SCHEMAS

    if kind not in SCHEMAS:
        raise ConfigError.unknown("KIND", "kind of file", kind, SCHEMAS)
    text = json.dumps(SCHEMAS[kind](), indent=1) + "\n"
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

    check_not_dash(folder)
    holders = [*names(), VIEWER]
    make(folder, holders, days)
    typer.echo(f"{folder}: certificates of {', '.join(holders)}; copy to each host only its own; do not commit them")

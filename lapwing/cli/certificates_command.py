"""`lapwing keys`: certificates for participants that meet over a network."""

from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import user_errors


@app.command()
def keys(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="to make; each participant needs its part of it")],
    days: Annotated[int, typer.Option(metavar="N", min=1, max=3650, help="for which they are valid")] = 365,
) -> None:
    """Make certificates for the services of a run on several hosts, and one that only reads, for viewers."""
    from lapwing.cosim.access.certificates import make
    from lapwing.cosim.access.zenoh_access import VIEWER
    from lapwing.services.security import names

    with user_errors():
        everybody = [*names(), VIEWER]
        make(folder, everybody, days)
        typer.echo(f"{folder}: certificates of {', '.join(everybody)}; give each host only its own, and commit none")

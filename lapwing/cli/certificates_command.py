"""`lapwing certificates`: certificates for runs on several hosts."""

from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import user_errors


@app.command()
def certificates(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="folder to create")],
    days: Annotated[int, typer.Option(metavar="N", min=1, max=3650, help="validity")] = 365,
) -> None:
    """Create TLS certificates for runs on several hosts.

    FOLDER gets a certificate for each service, and a read-only one for viewers.
    """
    from lapwing.cosim.access.certificates import make
    from lapwing.cosim.access.zenoh_access import VIEWER
    from lapwing.services.security import names

    with user_errors():
        holders = [*names(), VIEWER]
        make(folder, holders, days)
        typer.echo(f"{folder}: certificates of {', '.join(holders)}; copy to each host only its own, commit none")

"""`lapwing studio`: scenes and flights on a local web page."""

from typing import Annotated

import typer

from lapwing.cli.app import app


@app.command()
def studio(
    port: Annotated[int, typer.Option(metavar="N", min=0, max=65535, help="TCP port on 127.0.0.1; 0: any free")] = 0,
) -> None:
    """Pick, change, fly and compare scenes on a local web page.

    Serves on this machine only, until Ctrl-C. Needs pip install lapwing[studio].
    """
    from lapwing.studio.server import serve

    serve(port, typer.echo)

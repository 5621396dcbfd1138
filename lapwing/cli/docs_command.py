"""Pages and schemas made from the code."""

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import user_errors
from lapwing.cli.output_paths import claim

Out = Annotated[Path | None, typer.Option("--out", metavar="FILE", help="write it to a file instead of showing it")]
docs = typer.Typer(help="Pages and editor schemas made from the code.", rich_markup_mode=None)
app.add_typer(docs, name="docs")


class Kind(Enum):
    """A kind of file that people write."""

    scene = "scene"
    airframe = "airframe"
    gains = "gains"


@docs.command()
def reference(out: Out = None) -> None:
    """Every key of scenes, airframes and gain sets: unit, range, default, meaning (Markdown)."""
    from lapwing.docs.reference_page import reference

    with user_errors():
        _put(reference(), out)


@docs.command()
def api(out: Out = None) -> None:
    """The Python interface: signatures, units, shapes, errors (Markdown)."""
    from lapwing.docs.api_page import api

    with user_errors():
        _put(api(), out)


@docs.command()
def schema(
    of: Annotated[Kind, typer.Option(help="the kind of file")] = Kind.scene,
    out: Out = None,
) -> None:
    """The JSON schema with which editors complete and check the TOML files."""
    import json

    from lapwing.docs.json_schema import SCHEMAS

    with user_errors():
        _put(json.dumps(SCHEMAS[of.value](), indent=1) + "\n", out)


def _put(text: str, out: Path | None) -> None:
    if out is None:
        typer.echo(text, nl=False)
        return
    claim(out)
    out.write_text(text, encoding="utf-8")

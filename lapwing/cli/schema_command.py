"""`lapwing schema`: JSON schemas of the TOML files that users write."""

import json
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from lapwing.cli.app import app
from lapwing.cli.error_exit import user_errors
from lapwing.cli.output_paths import claim


class Kind(Enum):
    """A kind of file that users write."""

    scene = "scene"
    airframe = "airframe"
    gains = "gains"


@app.command()
def schema(
    kind: Annotated[Kind, typer.Argument(help="the kind of file")] = Kind.scene,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="the output file [standard output]")] = None,
) -> None:
    """Write a JSON schema with which editors check TOML files."""
    from lapwing.file_schemas.json_schema import SCHEMAS

    with user_errors():
        text = json.dumps(SCHEMAS[kind.value](), indent=1) + "\n"
        if out is None:
            typer.echo(text, nl=False)
        else:
            claim(out)
            out.write_text(text, encoding="utf-8")

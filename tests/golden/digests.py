"""File of golden digests: for each case, of the complete flight and of its beginning."""

import tomllib
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent
FILE = FOLDER / "digests.toml"
BEGINNING = 1.0  # [s]
HEAD = "# Digests of the shipped scenes; `python -m tests.golden` checks them, `--update` writes this file.\n"


class Golden(NamedTuple):
    """Expected digest of a case's flight."""

    digest: str  # of the complete flight
    beginning: str  # of the first BEGINNING s
    reason: str  # for its last change


def read() -> dict[str, Golden]:
    """Return the content of the file, by case."""
    return {name: Golden(**table) for name, table in tomllib.loads(FILE.read_text(encoding="utf-8")).items()}


def write(known: dict[str, Golden]) -> None:
    """Replace the file."""
    tables = []
    for name, golden in sorted(known.items()):
        entries = [f"{key} = {_text(value)}" for key, value in golden._asdict().items()]
        tables.append("\n".join([f'["{name}"]', *entries]) + "\n")
    FILE.write_text("\n".join([HEAD, *tables]), encoding="utf-8")


def sample_file(name: str) -> Path:
    """Return the path of the sample of a case's flight."""
    return FOLDER / "samples" / f"{name}.mcap"


def _text(value: str) -> str:
    return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'

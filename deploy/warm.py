"""Build step of the Dockerfile: kernels and matplotlib's list of fonts, in the folder $LAPWING_CACHE.

Of what an earlier image has, versions of kernels that others have replaced are dropped, so that images do not grow.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from lapwing.cli.main import main

cache = Path(os.environ["LAPWING_CACHE"])
opened: set[str] = set()


def note(event: str, arguments: tuple[Any, ...]) -> None:
    """Of an event of the interpreter: what is opened."""
    if event == "open":
        opened.add(str(arguments[0]))


sys.addaudithook(note)
sys.argv = ["lapwing", "warm"]
try:
    main()
except SystemExit as end:
    if end.code:
        raise
kept = sorted((path for path in (cache / "kernels").rglob("*") if path.is_file()), key=lambda p: p.stat().st_mtime)
newest = {str(path).rpartition("-")[0]: path for path in kept}
for path in kept:
    if path not in newest.values() and str(path) not in opened:
        path.unlink()
import matplotlib.font_manager  # noqa: E402, F401  (makes its list)

# Whoever the services run as reads the kernels, whose files nobody else can have written.
subprocess.run(["chmod", "-R", "a+rX,go-w", cache], check=True)
subprocess.run(["chmod", "-R", "a+rwX", os.environ["MPLCONFIGDIR"]], check=True)

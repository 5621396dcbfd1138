"""Build step of the Dockerfile: kernels and matplotlib's list of fonts, in the folder $LAPWING_CACHE.

Of what an earlier image has, kernels of which there is another version now are dropped, so that images do not grow.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from lapwing.cli.main import main

cache = Path(os.environ["LAPWING_CACHE"])
had = {path for path in (cache / "kernels").rglob("*") if path.is_file()}
opened: set[str] = set()


def note(event: str, arguments: tuple[Any, ...]) -> None:
    """Of an event of the interpreter: what is opened."""
    if event == "open":
        opened.add(str(arguments[0]))


sys.addaudithook(note)
sys.argv = ["lapwing", "precompile"]
try:
    main()
except SystemExit as end:
    if end.code:
        raise
kernels = [path for path in (cache / "kernels").rglob("*") if path.is_file()]
new = {str(path).rsplit("-", 2)[0] for path in kernels if path not in had}  # FOLDER/NAME of FOLDER/NAME-KEY-SOURCES
for path in had:
    if str(path) not in opened and str(path).rsplit("-", 2)[0] in new:
        path.unlink(missing_ok=True)
import matplotlib.font_manager  # noqa: E402, F401  (makes its list)

# Whoever the services run as reads the kernels, whose files nobody else can have written.
subprocess.run(["chmod", "-R", "a+rX,go-w", cache], check=True)
subprocess.run(["chmod", "-R", "a+rwX", os.environ["MPLCONFIGDIR"]], check=True)

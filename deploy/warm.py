"""Build step of the Dockerfile: kernels and matplotlib's list of fonts, in the folder $LAPWING_CACHE.

Kernels of an earlier image that now have another version are removed, so that images do not grow.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from lapwing.cli.main import main

cache = Path(os.environ["LAPWING_CACHE"])
earlier = {path for path in (cache / "kernels").rglob("*") if path.is_file()}
opened: set[str] = set()


def note(event: str, arguments: tuple[Any, ...]) -> None:
    """Store the path of each `open` event of the interpreter."""
    if event == "open":
        opened.add(str(arguments[0]))


sys.addaudithook(note)
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # workers would open kernels unnoticed
sys.argv = ["lapwing", "precompile"]
try:
    main()
except SystemExit as end:
    if end.code:
        raise
kernels = [path for path in (cache / "kernels").rglob("*") if path.is_file()]
new = {str(path).rsplit("-", 2)[0] for path in kernels if path not in earlier}  # FOLDER/NAME of FOLDER/NAME-KEY-SOURCES
for path in earlier:
    if str(path) not in opened and str(path).rsplit("-", 2)[0] in new:
        path.unlink(missing_ok=True)
import matplotlib.font_manager  # noqa: E402, F401  (creates its list of fonts)

# Services of any user read the kernels; only the owner can write them.
subprocess.run(["chmod", "-R", "a+rX,go-w", cache], check=True)
subprocess.run(["chmod", "-R", "a+rwX", os.environ["MPLCONFIGDIR"]], check=True)

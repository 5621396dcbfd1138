"""Picture of the studio's form: python docs/pictures/studio.py [FILE.png] (needs chromium)."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from lapwing.views.view3d.headless import Browser

HERE = Path(__file__).parent
CHANGED = "set=run.seed=7&set=effects.random_wind_force.mean=[6.0, 2.0, 0.0]#effects"
WAIT = """
while (document.readyState !== "complete" || !document.querySelector("#scene")?.dataset.previewed) {
  await new Promise((done) => setTimeout(done, 50));
}
document.querySelector("#filter").value = "wind";
document.querySelector("#filter").dispatchEvent(new Event("input"));
await new Promise((done) => setTimeout(done, 500));
scrollTo(0, 0);
"""


def main(target: Path | str) -> None:
    """Start the studio, and write the picture of a form."""
    command = [sys.executable, "-m", "lapwing", "studio"]
    environment = os.environ | {"BROWSER": "true", "PYTHONUNBUFFERED": "1"}
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as studio,
    ):
        try:
            assert studio.stdout is not None
            address = studio.stdout.readline().removeprefix("studio: ").strip()
            with Browser(f"{address}scenes/delivery_mission?{CHANGED}", size=(1280, 760)) as browser:
                browser.run(WAIT)
                Path(target).write_bytes(browser.picture())
        finally:
            studio.terminate()


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else HERE / "studio.png")

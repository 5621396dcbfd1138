"""Picture of the studio's form and 3D view: python docs/pictures/studio.py [FILE.png] (needs chromium)."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from urllib.parse import urlencode

from lapwing.cli.new_command import write_scene
from lapwing.views.view3d.headless import Browser

HERE = Path(__file__).parent
PLACED = (
    "trajectory.waypoints=[[0, 0, 3], [6, 0, 3], [7, 5, 4], [1, 6, 4]]",
    'environment.terrain.box=[{position = [8, -1], size = [2, 1.5], top = 2.5, name = "depot"}]',
    "fence.keep_in=[{corners = [[-3, -3], [10, -3], [10, 9], [-3, 9]]}]",
    "fence.keep_out=[{position = [9, 6.5], radius = 1.2}]",
)
WIND = "effects.wind_constant.velocity=[2, 1, 0]"
WAIT = """
while (document.readyState !== "complete" || !document.querySelector("#scene")?.dataset.previewed) {
  await new Promise((done) => setTimeout(done, 50));
}
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
            write_scene("my_flight", Path(folder))
            assert studio.stdout is not None
            address = studio.stdout.readline().removeprefix("studio: ").strip()
            query = urlencode([("add", "effects.wind_constant"), *(("set", text) for text in PLACED), ("set", WIND)])
            with Browser(f"{address}scenes/my_flight.toml?{query}", size=(1280, 900)) as browser:
                browser.run(WAIT)
                Path(target).write_bytes(browser.picture())
        finally:
            studio.terminate()


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else HERE / "studio.png")

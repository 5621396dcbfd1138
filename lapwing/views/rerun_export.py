"""Conversion of a log for the viewer Rerun, with a blueprint of its content."""

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from lapwing.cosim.log import LogReader

APPLICATION = "lapwing"
MISSING = "--rerun: Rerun is not installed; pip install lapwing[view]"
PLOTTED = ("battery", "sonar", "baro", "imu")  # topics that Rerun draws as curves


def program() -> str | None:
    """Return the path of the program `rerun` in this environment or on the PATH; None if it is missing."""
    return shutil.which("rerun", path=str(Path(sys.executable).parent)) or shutil.which("rerun")


def open_in_rerun(log: Path) -> Path:
    """Write a Rerun recording next to a log, start the viewer in the background, and return the recording's path.

    Raises:
        ValueError: not a log, or Rerun is not installed.
    """
    with LogReader(log) as recorded:
        topics = set(recorded.topics())
    result = program()
    if result is None or importlib.util.find_spec("rerun") is None:
        raise ValueError(MISSING)
    target = log.with_suffix(".rrd")
    convert(log, topics, target)
    subprocess.Popen([result, "--bind", "127.0.0.1", str(target)], start_new_session=True)
    return target


def convert(log: Path, topics: set[str], target: Path) -> None:
    """Write a log with these topics as a Rerun recording that starts with its blueprint."""
    import rerun

    recording = rerun.RecordingStream(APPLICATION)
    recording.save(target, default_blueprint=blueprint(topics))
    recording.log_file_from_path(log)
    recording.flush()
    recording.disconnect()


def blueprint(topics: set[str]) -> Any:
    """Return the layout of the viewer: 3D view next to curves, map and events of the existing topics."""
    import rerun.blueprint as layout

    vehicle = next((topic.split("/")[1] for topic in sorted(topics) if topic.endswith("/ground_truth")), "")

    def existing(name: str) -> str | None:
        topic = f"/{vehicle}/{name}"
        return topic if topic in topics else None

    views: list[Any] = [layout.TimeSeriesView(origin=t, name=name) for name in PLOTTED if (t := existing(name))]
    if place := existing("gps/fix"):
        views.append(layout.MapView(origin=place, name="map"))
    if source := existing("events"):
        views.append(layout.TextLogView(origin=source, name="events"))
    shown = [topic for topic in ("/tf", existing("pose"), existing("mag")) if topic in topics]
    space = layout.Spatial3DView(origin="/", contents=shown, name="3D view")
    return layout.Blueprint(layout.Horizontal(space, layout.Vertical(*views)), collapse_panels=True)

"""Size and loading time of the mission's report, first live image, video, and frames per second of the 3D view.

    python -m benchmarks.pages [--log LOG]      (default: a log of the delivery mission)

In headless Chromium with software rendering, which is the slow case: a laptop has a graphics processor. Frames are
counted without the limit of the display's rate. The work of the page for a frame is measured as processor time in a
page whose drawing calls do nothing.
"""

import copy
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks._command import command_line
from benchmarks._targets import LAPWING, Row, show
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.flights.flight_data import SHOWN, FlightData
from lapwing.flights.topic_view import TopicView
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.views.live.live_feed import LiveFeed
from lapwing.views.live.live_page import LivePage
from lapwing.views.report import write
from lapwing.views.view3d.headless import Browser
from lapwing.views.view3d.recording import page
from lapwing.views.view3d.render import Shot, render

VEHICLES, APART = 8, 3.0  # [m] between neighbours
SECONDS = 10.0  # [s] time in which frames are counted
SIZE = (1280, 720)  # [pixel]
UNLIMITED = "--disable-gpu-vsync --disable-frame-rate-limit"  # otherwise no page draws more than 60 frames/s
DRAWN = """
for (;;) {
  if (document.querySelector(".js-plotly-plot .main-svg")) return performance.now();
  await new Promise((done) => setTimeout(done, 5));
}
"""
FILM = 180.0  # [s]
READY = "while (!window.lapwingView?.ready) await new Promise((done) => setTimeout(done, 5));"
FRAME, FRAMES = 1000.0 / 60.0, 300  # [ms] longest time of a frame; frames that are stepped
RATE = f"""
{READY}
const begin = lapwingView.frames(), start = performance.now();
await new Promise((done) => setTimeout(done, {1000 * SECONDS}));
return 1000 * (lapwingView.frames() - begin) / (performance.now() - start);
"""


def rows(log):
    with tempfile.TemporaryDirectory() as folder:
        if log is None:
            log = str(Path(folder, "log.mcap"))
            words = ["run", "delivery_mission", "--mode", "single-process", "--speed", "max", "--log", log]
            subprocess.run([*LAPWING, *words], check=True, stdout=subprocess.DEVNULL)
        flight = FlightData.read(log, only=SHOWN)
        for view3d, bar in ((False, 2.0), (True, 5.0)):
            report = write(flight, Path(folder, "report.html"), view3d)
            name = "with" if view3d else "without"
            yield Row(f"report of the mission {name} 3D view", report.stat().st_size / 1e6, "MB", bar)
            wall, cpu = loading_time(report)
            yield Row(f"first plot of that report {name} 3D view", wall, "s", 1.0)
            yield Row(f"first plot {name} 3D view, processor time of its thread", cpu, "s", 1.0)
        yield Row("first image of --view after the first tick", first_image(), "s", 1.0)
        start = time.monotonic()
        render([flight], [flight.vehicle], Path(folder, "film.mp4"), Shot())
        yield Row(
            "video of the mission, {}x{}, {:g} frames per second".format(*Shot().size, Shot().rate),
            time.monotonic() - start,
            "s",
            FILM,
        )
        for count in (1, VEHICLES):
            view = Path(folder, "view.html")
            view.write_text(page([fleet(flight, count)], [flight.vehicle]), encoding="utf-8")
            with Browser(view, size=SIZE, flags=UNLIMITED) as browser:
                yield Row(f"frames of the 3D view, {count} vehicles", browser.run(RATE), "1/s", 1000.0 / FRAME, True)
            cpu, draws, sent = frame_work(view)
            yield Row(f"processor time of the page for a frame, {count} vehicles", cpu, "ms", FRAME)
            yield Row(f"draw calls of a frame, {count} vehicles", draws, "1", 120)
            yield Row(f"uploads of a frame, {count} vehicles", sent / 1e3, "kB", 200)


def frame_work(view):
    """Return processor time [ms] of a page's thread, draw calls and uploads [bytes] per frame at 60 frames/s."""
    with Browser("data:text/html,empty", size=SIZE) as browser:
        script = Path(__file__).with_name("frame_work.js").read_text(encoding="utf-8")
        browser.call("Page.addScriptToEvaluateOnNewDocument", source=script)
        browser.call("Performance.enable", timeDomain="threadTicks")
        browser.call("Page.navigate", url=view.resolve().as_uri())
        step = f"return stepFrames({FRAMES}, {1000.0 / FRAME});"
        browser.run(f"{READY} {step}")  # first run: the browser compiles its scripts
        before = _task_duration(browser)
        draws, sent, played = browser.run(step)
        assert abs(1000.0 * played - FRAME) < 1.0, f"{played} s of flight in a frame"
        return 1000.0 * (_task_duration(browser) - before) / FRAMES, draws, sent


def _task_duration(browser):
    """Return the processor time [s] of the page's thread since its start."""
    metrics = {entry["name"]: entry["value"] for entry in browser.call("Performance.getMetrics")["metrics"]}
    return metrics["TaskDuration"]


def loading_time(report):
    """Return wall time and processor time [s] from the request of a page to its first plot; best of 3."""
    times = []
    for _ in range(3):
        with Browser("data:text/html,empty", size=SIZE) as browser:
            browser.call("Performance.enable", timeDomain="threadTicks")
            browser.call("Page.navigate", url=report.resolve().as_uri())
            wall = 1e-3 * browser.run(DRAWN)
            times.append((wall, _task_duration(browser)))
    return tuple(map(min, zip(*times, strict=True)))


class Watch:
    """Hover flight in this process with the interface of a run monitor."""

    def __init__(self):
        self.config = resolve(load("hover"))
        self._diagram = BlockDiagram(self.config, create_all(self.config), KEPT_TICKS)
        self.reporting_services, self.on_batches, self.time_ns = set(self.config.services), None, 0
        self.complete = False

    def publish(self, *_):
        pass

    def step(self, seconds):
        before = self._diagram.tick
        stop = before + round(seconds * self.config.rate)
        self._diagram.advance(stop)
        self.on_batches(self._diagram.record_batches(before, stop))
        self.time_ns = (stop - 1) * self.config.interval_ns


def first_image():
    """Return the time [s] from the first step of a flight to the first image with the vehicle in an open page."""
    watch = Watch()
    with LivePage(watch.config) as live:
        feed = LiveFeed(watch.config, [live.show])
        feed.observe(watch)
        with Browser(live.address, size=SIZE) as browser:
            browser.run("while (!document.querySelector('canvas')) await new Promise((done) => setTimeout(done, 50));")
            time.sleep(3.0)
            start = time.monotonic()
            for _ in range(3):  # ten steps per second, as in a run
                watch.step(0.1)
                feed.observe(watch)
            browser.run(READY)
            return time.monotonic() - start


def fleet(flight, count):
    """Return a fleet of `count` copies of a flight in a row."""
    first = copy.copy(flight)
    others = []
    for k in range(1, count):
        truth = {name: flight.truth[name] for name in flight.truth.fields}
        truth["pose.position"] = flight.truth.position + np.array([0.0, APART * k, 0.0])
        views = {"ground_truth": TopicView(flight.truth._times_ns, truth)}
        others.append(FlightData(views, copy.copy(flight.origin)))
        others[-1].vehicle = f"vehicle {k + 1}"
    first.others = tuple(others)
    first.fleet = {other.vehicle: other.truth for other in (flight, *others)}
    return first


def main(log: Path | None = None) -> list[Row]:
    return show(rows(log))


if __name__ == "__main__":
    command_line(main)

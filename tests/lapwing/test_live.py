"""Live page of a run: access, and drawing in a browser."""

import os
import re
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from lapwing import read_log
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.kernels import cache_folder
from lapwing.messages import Log
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.views.live.live_feed import LiveFeed
from lapwing.views.view3d import headless as chromium
from lapwing.views.view3d import recording

pytest.importorskip("viser", reason="needs viser (pip install lapwing[view3d])")
from lapwing.views.live.live_page import LivePage

pytestmark = pytest.mark.long

PATIENCE = 120.0  # [s]


def get(address, **headers):
    return urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=PATIENCE)


def refused(address, **headers):
    with pytest.raises(urllib.error.HTTPError) as error:
        get(address, **headers)
    return error.value.code


def handshake_status(address, **headers):
    """Return the status line of a WebSocket handshake."""
    host, port, path = re.fullmatch(r"http://([\d.]+):(\d+)(/.*)", address).groups()
    lines = {
        "Host": f"{host}:{port}",
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
        **headers,
    }
    request = f"GET {path} HTTP/1.1\r\n" + "".join(f"{key}: {value}\r\n" for key, value in lines.items()) + "\r\n"
    with socket.create_connection((host, int(port)), PATIENCE) as connection:
        connection.sendall(request.encode())
        return connection.recv(1 << 12).split(b"\r\n")[0].decode()


class Run:
    """A run in this process that publishes steps of half a second, like a launcher."""

    def __init__(self, scene="hover", overrides=()):
        self.config = resolve(load(scene, {"run.duration": 3.0, **dict(overrides)}))
        self._diagram = BlockDiagram(self.config, create_all(self.config), KEPT_TICKS)
        self.reporting_services, self.on_batches, self.time_ns = set(self.config.services), None, 0
        self.published, self.complete = [], False

    def publish(self, key, time_ns, payload):
        self.published.append((key, time_ns, Log.decode(payload)))

    def step(self):
        before, rows = self._diagram.tick, self.config.rate // 2
        for first in range(before, before + rows, KEPT_TICKS // 2):
            stop = min(first + KEPT_TICKS // 2, before + rows)
            self._diagram.advance(stop)
            self.on_batches(self._diagram.record_batches(first, stop))
        self.time_ns = (before + rows - 1) * self.config.interval_ns


@pytest.mark.filterwarnings("error::DeprecationWarning")
def show(run, page, frames):
    """Show a run at its start and in later frames."""
    follow = LiveFeed(run.config, [page.show])
    follow.observe(run)
    for _ in range(frames):
        run.step()
        follow.observe(run)


def test_page_opens_without_deprecated_options_of_viser():
    with LivePage(Run().config) as page:
        assert page.address.startswith("http://127.0.0.1:")


def test_page_needs_its_secret_its_host_and_its_origin():
    with LivePage(Run().config) as page:
        port, token = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]{22})/", page.address).groups()
        answer = get(page.address)
        text = answer.read().decode()
        assert "window.lapwing=" in text
        assert not re.search(r'<(script|link|img|iframe)[^>]+(src|href)="http', text)
        assert answer.headers["Referrer-Policy"] == "no-referrer"
        assert get(f"http://localhost:{port}/{token}/").status == 200
        for path in ("", "index.html", "x" * 22 + "/"):
            assert refused(f"http://127.0.0.1:{port}/{path}") == 404
        assert refused(page.address, Host="example.org") == 403
        assert refused(page.address, Host=f"example.org:{port}") == 403
        assert refused(page.address, Origin="http://example.org") == 403
        assert refused(page.address, Origin="null") == 403
        own = f"http://127.0.0.1:{port}"
        assert " 101 " in handshake_status(page.address, Origin=own)
        assert " 403 " in handshake_status(page.address, Origin="http://example.org")
        assert " 403 " in handshake_status(page.address, Host="example.org", Origin=own)
        assert " 404 " in handshake_status(f"{own}/", Origin=own)
    with pytest.raises(urllib.error.URLError):
        get(page.address)


def test_events_of_fleet_are_published_and_listed_by_vehicle():
    run = Run("fleet")
    with LivePage(run.config) as page:
        show(run, page, 2)
        names = [vehicle.name for vehicle in page._vehicles]
        lines = page._events.value.splitlines()
    assert names == ["left", "right", "scout"]
    assert len(lines) == len(run.published)
    assert {line.split()[1] for line in lines} == set(names)
    assert {key for key, _, message in run.published if message.name == "arming"} == {f"{n}/events" for n in names}


def test_latest_scan_of_lidar_is_shown_live():
    run = Run(overrides={"sensors.lidar.columns": 36, "success.require": []})
    with LivePage(run.config) as page:
        show(run, page, 3)
        page._player.join(3.0)  # it shows the frames in the meantime
        (vehicle,) = page._vehicles
        cloud = vehicle._optional["lidar"]._cloud
    assert cloud.visible
    assert 10 < len(cloud.points) <= 36 * 16
    assert np.abs(cloud.points[:, 2] + cloud.position[2]).max() < 0.3  # on the ground, within its noise


@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_browser_follows_running_flight():
    run = Run()
    with LivePage(run.config) as page:
        follow = LiveFeed(run.config, [page.show])
        follow.observe(run)
        for _ in range(3):
            run.step()
            follow.observe(run)
        with chromium.Browser(page.address) as browser:
            height = browser.run(
                """
                const until = async (holds) => {
                  for (let k = 0; k < 1200 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
                  if (!holds()) throw new Error(`never: ${holds}`);
                };
                await until(() => window.lapwingView?.ready);
                await until(() => lapwingView.camera().target[1] > 0.05);
                return lapwingView.camera().target[1];
                """
            )
            assert browser.errors == []
    assert 0.05 < height < 3.0  # the camera looks at the vehicle


def test_run_is_shown_from_command_line(tmp_path):
    words = ["run", "hover", "--view", "--set", "run.duration=3", "--log", str(tmp_path / "a.mcap")]
    command = [sys.executable, "-m", "lapwing", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | {"BROWSER": "true"}) as run:
        address = run.stdout.readline().removeprefix("live: ").strip()
        assert b"window.lapwing=" in get(address).read()
        assert refused(address, Host="example.org") == 403
        rest = run.stdout.read()
        assert run.wait(PATIENCE) == 0
    assert "viser" not in rest


INVALID = ("", "?vehicle=none&kind=arm", "?vehicle=drone1&kind=finish", "?vehicle=drone1&kind=manual&values=1,x")


def test_sticks_of_the_page_fly_the_vehicle_and_the_flight_is_repeated(tmp_path):
    log = tmp_path / "log.mcap"
    command = [sys.executable, "-u", "-m", "lapwing", "run", "groundstation", "--view", "--log", str(log)]
    for key in ("autopilot.estimator=ground_truth", "run.duration=14.0"):
        command += ["--set", key]
    environment = {**os.environ, "BROWSER": "true", "LAPWING_CACHE": str(cache_folder())}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as run:
        assert run.stdout is not None
        address = next(match[1] for line in run.stdout if (match := re.search(r"live: (\S+)", line)))
        assert '"sticks":["drone1"]' in get(address).read().decode()
        for query in INVALID:
            assert refused(f"{address}sticks{query}") == 400
        assert refused(f"{address}sticks?vehicle=drone1&kind=arm", Origin="http://example.org") == 403
        faults = []
        while run.poll() is None:  # forward and up, until the page is gone
            for query in ("kind=arm", "kind=position_control", "kind=manual&values=1,0,0.5,0"):
                try:
                    get(f"{address}sticks?vehicle=drone1&{query}")
                except urllib.error.HTTPError as error:
                    faults.append(error.code)
                except OSError:  # the page is gone
                    pass
            time.sleep(0.05)
    assert faults == []
    flight = read_log(log)
    assert flight.status.times[flight.status.armed][0] > 0.1  # commands before the first step are ignored
    position = flight.truth.position
    assert min(position[:, 0].max(), position[:, 2].max()) > 1.0
    command = [sys.executable, "-m", "lapwing", "resimulate", str(log)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr


STICKS = """<div id="lapwing"></div><script>
const sent = [];
window.fetch = async (address) => sent.push(new URLSearchParams(address.split("?")[1]));
window.lapwing = { sticks: ["b"], names: ["a", "b"] };
window.lapwingView = { vehicle: 1 };
</script><script src="SCRIPT"></script>"""


@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_keys_and_gamepad_of_the_page_become_sticks(tmp_path):
    page = tmp_path / "sticks.html"
    script = Path(recording.__file__).parent / "sticks.js"
    page.write_text(STICKS.replace("SCRIPT", script.as_uri()))
    with chromium.Browser(page) as browser:
        found = browser.run(
            """
            const wait = (seconds) => new Promise((done) => setTimeout(done, 1e3 * seconds));
            const key = (kind, code) => dispatchEvent(new KeyboardEvent(kind, { code, cancelable: true }));
            const until = async (values) => {
              for (let k = 0; k < 300 && sent.at(-1)?.get("values") !== values; k++) await wait(0.05);
              return sent.splice(0).map((each) => [...each.values()].join(" "));
            };
            while (document.readyState !== "complete") await wait(0.05);
            await wait(0.5);
            const before = sent.length;
            key("keydown", "ArrowUp"), key("keydown", "KeyA");
            const flown = await until("1,0,0,1");
            key("keyup", "ArrowUp"), key("keyup", "KeyA"), key("keydown", "KeyL");
            const landed = await until("0,0,0,0");
            const pad = { connected: true, axes: [0, -0.5, 0.25, 0], buttons: [] };
            navigator.getGamepads = () => [null, pad];
            const taken = await until("0,-0.25,0.5,0");
            pad.axes = [0, 0, 0, 0];
            await until("0,0,0,0");
            pad.axes = [0, -1, 0, 0];
            const again = (await until("0,0,1,0")).filter((each) => !each.includes("manual")); // may be disarmed
            return [before, flown.slice(0, 3), landed.includes("b land "), taken.slice(-1), again];
            """
        )
        assert browser.errors == []
    flown = ["b position_control ", "b arm ", "b manual 1,0,0,1"]
    assert found == [0, flown, True, ["b manual 0,-0.25,0.5,0"], flown[:2]]

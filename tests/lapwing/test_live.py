"""Live page of a run: access, and drawing in a browser."""

import os
import re
import socket
import subprocess
import sys
import urllib.error
import urllib.request

import numpy as np
import pytest

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import KEPT_TICKS
from lapwing.messages import Log
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.views.live.live_feed import LiveFeed
from lapwing.views.view3d import headless as chromium

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

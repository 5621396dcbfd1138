"""A run on a page while it goes on: who may see it, what it is given, and that a browser draws it."""

import base64
import json
import os
import re
import subprocess
import sys
import urllib.error
import urllib.request

import numpy as np
import pytest

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.executors.single_process import PAGE
from lapwing.messages import Log
from lapwing.runs.live_feed import LiveFeed
from lapwing.runs.live_page import LivePage
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve
from lapwing.studies.report.motion_3d import steps_to_json
from tests.studies import chromium

pytestmark = pytest.mark.long

PATIENCE = 120.0  # [s]


def get(address):
    return urllib.request.urlopen(address, timeout=PATIENCE)


def steps(stream):
    """What a browser is given, to the end of the stream."""
    found = []
    for line in stream:
        text = line.decode().rstrip("\n")
        if text.startswith("event: over"):
            break
        if text.startswith("data: "):
            found.append(json.loads(text.removeprefix("data: ")))
    return found


class Run:
    """A run in this process, half a second a step, as a launcher would see it."""

    def __init__(self, scene="hover", overrides=()):
        self.setup = resolve(load(scene, {"run.duration": 3.0, **dict(overrides)}))
        self._graph = BlockDiagram(self.setup, create_all(self.setup), PAGE)
        self.reporting_services, self.listen, self.time_ns = set(self.setup.services), None, 0
        self.published = []

    def publish(self, key, time_ns, payload):
        self.published.append((key, time_ns, Log.decode(payload)))

    def step(self):
        before, rows = self._graph.tick, self.setup.rate // 2
        for first in range(before, before + rows, PAGE // 2):
            stop = min(first + PAGE // 2, before + rows)
            self._graph.advance(stop)
            self.listen(self._graph.pages(first, stop))
        self.time_ns = (before + rows - 1) * self.setup.interval_ns


def test_only_who_has_the_address_sees_it_and_only_while_it_flies():
    run = Run()
    with LivePage(run.setup) as page:
        port = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/[\w-]{22}/", page.address)[1]
        text = get(page.address).read().decode()
        assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)=", text)
        for path in ("", "steps", "x" * 22 + "/", "x" * 22 + "/steps"):
            with pytest.raises(urllib.error.HTTPError) as refused:
                get(f"http://127.0.0.1:{port}/{path}")
            assert refused.value.code == 404
        follow = LiveFeed(run.setup, [page.show])
        follow.observe(run)
        early = get(page.address + "steps")
        for _ in range(4):
            run.step()
            follow.observe(run)
        late = get(page.address + "steps")
    seen = steps(early)
    assert seen == steps(late)
    assert [step["end"] for step in seen] == pytest.approx([0.496, 0.996, 1.496, 1.996])
    events = [kind for step in seen for _, _, kind, _ in step["events"]]
    assert sorted(events) == ["arming", "contact", "mode", "phase"]
    assert [(key, message.name) for key, _, message in run.published] == [("drone1/events", kind) for kind in events]
    with pytest.raises(urllib.error.URLError):
        get(page.address)


def test_of_a_fleet_every_vehicle_is_shown_and_its_events_are_its_own():
    run, shown = Run("fleet"), []
    names = ["left", "right", "scout"]
    follow = LiveFeed(run.setup, [lambda steps, events: shown.append(json.loads(steps_to_json(steps, events, True)))])
    follow.observe(run)
    for _ in range(2):
        run.step()
        follow.observe(run)
    assert [[flight["name"] for flight in step["flights"]] for step in shown] == [names] * 2
    starts = [np.frombuffer(base64.b64decode(flight["path"]), "<f4")[:2] for flight in shown[0]["flights"]]
    assert np.array(starts) == pytest.approx(np.array([(0.0, 3.0), (0.0, -3.0), (-3.0, 0.0)]), abs=1e-3)
    told = [(f"{vehicle}/events", kind) for step in shown for _, vehicle, kind, _ in step["events"]]
    assert sorted(told) == sorted((key, message.name) for key, _, message in run.published)
    assert {key for key, kind in told if kind == "arming"} == {f"{name}/events" for name in names}


@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_a_browser_draws_it_follows_it_and_keeps_it(tmp_path):
    run = Run(overrides={"rates.contact_forces": 125})
    until = "const until = async (holds) => { while (!holds()) await new Promise((done) => setTimeout(done, 20)); };"
    until += 'await until(() => document.readyState === "complete");'
    until += 'const section = document.getElementById("motion"), state = document.getElementById("state");'
    with LivePage(run.setup) as page:
        follow = LiveFeed(run.setup, [page.show])
        follow.observe(run)
        with chromium.Browser(page.address, tmp_path / "profile") as browser:
            browser.run(until + 'await until(() => state && state.textContent.startsWith("waiting"));')
            for _ in range(2):
                run.step()
                follow.observe(run)
            browser.run(until + "await until(() => Number(section.dataset.time) > 0.9);")
            for _ in range(2):
                run.step()
                follow.observe(run)
            browser.run(until + "await until(() => Number(section.dataset.time) > 1.9);")
            page.__exit__()
            path, rotors, events, forces = browser.run(
                until
                + """
                await until(() => state.textContent === "the flight is over");
                const slider = section.querySelector("[name=time]");
                slider.value = 1.0;
                slider.dispatchEvent(new Event("input"));
                await until(() => Number(section.dataset.time) < 1.1);
                const named = (name) => section.querySelector(".space").data.filter((trace) => trace.name === name);
                const rows = document.querySelectorAll(".events tbody tr").length;
                const rotors = section.querySelector(".space").data.findLast(({ line }) => line && line.width === 3);
                const shown = [named("flown")[0].z, rotors.z.filter((value) => value !== null).length, rows];
                section.querySelector("[name=forces]").click();
                slider.value = 0;
                slider.dispatchEvent(new Event("input"));
                await until(() => Number(section.dataset.time) === 0);
                const arrows = () => named("force of contact or joint")[0].z.filter((value) => value !== null);
                await until(() => arrows().length > 0);
                return [...shown, arrows()];
                """
            )
            assert browser.errors == []
    assert len(path) == 12 + 3 * 11 + 1  # the first row of a step is the last of the one before; a gap at the end
    assert np.all(np.diff(path[6:-1]) > -1e-6)  # it climbs
    assert rotors == 4 * (25 + 2)
    assert events == 4
    weight = [max(forces[k : k + 5]) - forces[k] for k in range(0, len(forces), 5)]  # of each arrow, 0.02 m for 1 N
    assert weight == pytest.approx([0.02 * 10.0224 * 9.80665 / 4] * 4, rel=1e-3)


def test_a_run_is_shown_from_the_command_line(tmp_path):
    words = ["run", "hover", "--view", "--set", "run.duration=3", "--log", str(tmp_path / "a.mcap")]
    command = [sys.executable, "-m", "lapwing", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | {"BROWSER": "true"}) as run:
        line = run.stdout.readline()
        seen = steps(get(line.removeprefix("live: ").strip() + "steps"))
        assert run.wait(PATIENCE) == 0
    assert seen[-1]["end"] == pytest.approx(3.0)
    assert len(seen) > 5

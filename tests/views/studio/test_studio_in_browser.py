"""`lapwing studio` in headless Chromium: select a scene, change it, run it, view it, compare flights."""

import time
import tomllib
import urllib.error
import urllib.request

import pytest

from lapwing.cli.new_command import write_scene
from lapwing.views.view3d import headless as chromium

pytest.importorskip("starlette", reason="needs starlette (pip install lapwing[studio])")
pytest.importorskip("uvicorn", reason="needs uvicorn (pip install lapwing[studio])")
pytest.importorskip("viser", reason="needs viser (pip install lapwing[view3d])")

pytestmark = [pytest.mark.long, pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")]

PATIENCE = 300.0  # [s] for a page on a busy machine
HELPERS = """
const until = async (holds) => {
  for (let k = 0; k < 5000; k++) {
    try { const found = holds(); if (found) return found; } catch {}
    await new Promise((done) => setTimeout(done, 50));
  }
  throw new Error(`never: ${holds}`);
};
const one = (selector) => document.querySelector(selector);
const key = (name) => one(`[data-key="${name}"]`);
const type = (name, text) => {
  const input = key(name).querySelector("input");
  input.value = text;
  input.dispatchEvent(new Event("input", { bubbles: true }));
};
"""


class User:
    """User who follows links from page to page."""

    def __init__(self, browser):
        self._browser = browser

    def do(self, script):
        """Run a script in the page; again if the page was left meanwhile."""
        while True:
            try:
                return self._browser.run(HELPERS + script)
            except chromium.BrowserError as error:
                if "navigated" not in str(error):
                    raise

    def go(self, script, part):
        """Leave the page by a script; wait for a page whose address contains `part`."""
        self._browser.run(HELPERS + f"setTimeout(() => {{ {script} }}, 0);")
        deadline = time.monotonic() + PATIENCE  # attempts fail at once while the page changes
        while time.monotonic() < deadline:
            try:
                if part in self._browser.run(
                    "await new Promise((done) => setTimeout(done, 50)); "
                    'return document.readyState === "complete" ? location.href : "";'
                ):
                    return
            except chromium.BrowserError:  # the page changed during the script
                continue
        raise AssertionError(f"no page {part}")


def fly(user, changed):
    """Select hover, change it and fly it; return the displayed command line."""
    user.do("await until(() => one('a[href$=\"scenes/hover\"]'));")
    user.go("one('a[href$=\"scenes/hover\"]').click()", "scenes/hover")
    for name, text in changed.items():
        user.do(f"type({name!r}, {text!r});")
    command = user.do(
        f"""
        one("[name=speed]").value = "max";
        one("[name=view]").checked = false;
        one("[name=speed]").dispatchEvent(new Event("input", {{ bubbles: true }}));
        await until(() => one("#command").textContent.includes("--speed max"));
        await until(() => document.querySelectorAll(".field.changed").length === {len(changed)});
        return one("#command").textContent;
        """
    )
    user.go("one('.button.main').click()", "runs/")
    return command


def test_user_selects_changes_runs_views_and_compares(start, tmp_path):
    studio = start(tmp_path)
    with chromium.Browser(studio.address, (1280, 900)) as browser:
        user = User(browser)
        assert fly(user, {}) == "lapwing run hover --speed max"
        user.do("await until(() => one('.outcome'));")
        user.go("one('.brand').click()", studio.address)
        command = fly(user, {"run.seed": "7", "trajectory.phase.0.z.to": "1.5"})
        assert command == "lapwing run hover --set trajectory.phase.0.z.to=1.5 --set run.seed=7 --speed max"
        outcome = user.do("return (await until(() => one('.outcome.good'))).textContent;")
        assert outcome.startswith("Landed at ")
        frame = user.do("return (await until(() => one('iframe.report'))).src;")
        user.go(
            "[...document.querySelectorAll('.button')].find((b) => b.textContent.startsWith('Compare')).click()",
            "compare?",
        )
        differs = user.do("return [...document.querySelectorAll('.differs')].map((row) => row.textContent);")
        assert any(text.startswith("run.seed") and "17" in text for text in differs)
        browser.call("Emulation.setDeviceMetricsOverride", width=390, height=800, deviceScaleFactor=1, mobile=False)
        widths = user.do("return [one('.scroll').scrollWidth, one('.scroll').clientWidth];")
        assert widths[0] <= widths[1]  # both flights fit in the window of a phone
        browser.call("Emulation.setDeviceMetricsOverride", width=1280, height=900, deviceScaleFactor=1, mobile=False)
        user.go("one('.brand').click()", studio.address)
        cards = user.do(
            """
            await until(() => document.querySelectorAll(".card polyline.path").length === 2);
            for (const box of document.querySelectorAll("input[name=flight]")) box.click();
            const button = one("#compare");
            return [button.textContent, button.disabled];
            """
        )
        assert cards == ["Compare 2 flights", False]
        user.go("one('#compare').click()", "compare?")
        user.go(f"location.href = {frame!r}", "/report")  # the report has a separate sandbox
        drawn = user.do(
            """
            one("#position").scrollIntoView();
            await until(() => one("#position .js-plotly-plot"));
            return one("h1").textContent;
            """
        )
        assert drawn == "hover"
        assert browser.errors == []


def test_user_watches_flight_live_and_stops(start, tmp_path):
    studio = start(tmp_path)
    long = {"speed": "1", "view": "yes", "run.duration": "3000", "trajectory.phase.1.duration": "2500"}
    status, _, headers = studio.request("scenes/hover/run", long)
    assert status == 303
    with chromium.Browser(f"{studio.origin}{headers['Location']}", (900, 700)) as browser:
        user = User(browser)
        user.do("await until(() => one('#time').textContent.includes('simulated'));")
        live = user.do("return (await until(() => one('iframe.live').src));")
        assert live.startswith("http://127.0.0.1:")
        user.do("one('form button').click();")
        outcome = user.do("return (await until(() => one('.outcome'))).textContent;")
        assert "in mission (hover)" in outcome or "Aborted" in outcome or "Completed" in outcome
    with pytest.raises(urllib.error.URLError):  # the live view ended with its run
        urllib.request.urlopen(live, timeout=10.0)


def test_page_fits_phone(start, tmp_path):
    studio = start(tmp_path)
    with chromium.Browser(f"{studio.address}scenes/delivery_mission", (390, 800)) as browser:
        width = User(browser).do(
            """
            await until(() => document.readyState === "complete" && one("#scene").dataset.previewed);
            return [document.documentElement.scrollWidth, innerWidth];
            """
        )
    assert width[0] <= width[1]


PLACES = """
[[environment.terrain.box]]
position = [4.0, 4.0]
size = [2.0, 1.0]
top = 1.5
[effects.wind_constant]
velocity = [2.0, 0.0, 0.0]
"""


def test_user_drags_waypoint_building_start_and_wind(start, tmp_path):
    write_scene("mine", tmp_path)
    scene = tmp_path / "mine.toml"
    scene.write_text(scene.read_text() + PLACES)
    studio = start(tmp_path)
    with chromium.Browser(f"{studio.address}scenes/mine.toml", (1280, 900)) as browser:
        user = User(browser)
        changed = user.do(
            """
            const move = (what, dx, dy, more) => {
              const box = one(what).getBoundingClientRect(), [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
              const send = (to, kind, x, y) => to.dispatchEvent(
                new PointerEvent(kind, { clientX: x, clientY: y, pointerId: 1, bubbles: true, ...more }));
              one("#map").setPointerCapture = () => {};
              send(one(what), "pointerdown", x, y);
              send(one("#map"), "pointermove", x + dx, y + dy);
              send(one("#map"), "pointerup", x + dx, y + dy);
            };
            await until(() => one("#map .waypoint"));
            move("#map .waypoint", 0, -30, { shiftKey: true });
            for (const what of [".building", ".start", "circle.wind"]) move(`#map ${what}`, 25, 0, {});
            await until(() => document.querySelectorAll(".field.changed").length === 4);
            return [one("#toml").textContent, one("#command").textContent, one("#problem").hidden];
            """
        )
        assert browser.errors == []
    text, command, valid = changed
    assert valid
    tables, before = tomllib.loads(text), tomllib.loads(scene.read_text())
    first, *others = tables["trajectory"]["waypoints"]
    assert first[:2] == before["trajectory"]["waypoints"][0][:2]
    assert first[2] > before["trajectory"]["waypoints"][0][2]
    assert others == before["trajectory"]["waypoints"][1:]
    (box,) = tables["environment"]["terrain"]["box"]
    assert {**box, "position": [4.0, 4.0]} == before["environment"]["terrain"]["box"][0]
    assert box["position"][0] > 4.0
    assert tables["vehicle"]["initial_position"][0] > 0.0
    assert tables["effects"]["wind_constant"]["velocity"][1] > 0.0
    assert "--set 'trajectory.waypoints=" in command

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


class Mouse:
    """Real mouse of a browser, on the centres of elements."""

    def __init__(self, browser):
        self._browser, self._user = browser, User(browser)

    def _send(self, kind, place, pressed, count=1, shift=False):
        x, y = place
        options = {"button": "left", "buttons": int(pressed), "clickCount": count, "modifiers": 8 * shift}
        self._browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **options)

    def place_of(self, selector):
        return self._user.do(
            f"const box = (await until(() => one({selector!r}))).getBoundingClientRect();"
            "return [box.x + box.width / 2, box.y + box.height / 2];"
        )

    def click(self, selector, dx=0.0, dy=0.0, count=1):
        x, y = self.place_of(selector)
        for number in range(1, count + 1):
            self._send("mousePressed", (x + dx, y + dy), True, number)
            self._send("mouseReleased", (x + dx, y + dy), False, number)

    def drag(self, selector, dx, dy, shift=False):
        x, y = self.place_of(selector)
        self._send("mousePressed", (x, y), True, 1, shift)
        for share in (0.5, 1.0):
            self._send("mouseMoved", (x + share * dx, y + share * dy), True, 0, shift)
        self._send("mouseReleased", (x + dx, y + dy), False, 1, shift)


def changed_tables(user, number, part):
    """Return the changes as tables, as soon as so many fields have changed without a fault, and `part` with them."""
    text = user.do(
        f"""
        await until(() => document.querySelectorAll(".field.changed").length === {number} && one("#problem").hidden);
        await until(() => one("#toml").textContent.includes({part!r}));
        return one("#toml").textContent;
        """
    )
    return tomllib.loads(text)


def test_user_drags_waypoint_building_start_and_wind(start, tmp_path):
    write_scene("mine", tmp_path)
    scene = tmp_path / "mine.toml"
    scene.write_text(scene.read_text() + PLACES)
    studio = start(tmp_path)
    with chromium.Browser(f"{studio.address}scenes/mine.toml", (1280, 900)) as browser:
        user, mouse = User(browser), Mouse(browser)
        mouse.drag("#map .waypoint", 0, -30, shift=True)
        for what in (".building", ".start", "circle.wind"):
            mouse.drag(f"#map {what}", 25, 0)
        tables = changed_tables(user, 4, "wind_constant")
        assert "--set 'trajectory.waypoints=" in user.do("return one('#command').textContent")
        user.do("type('trajectory.waypoints', '[[0.0, 0.0, 3.0], [7.0, 0.0]]');")  # not yet complete
        user.do("await until(() => key('trajectory.waypoints').querySelector('.fault').textContent);")
        assert browser.errors == []
    before = tomllib.loads(scene.read_text())
    first, *others = tables["trajectory"]["waypoints"]
    assert first[:2] == before["trajectory"]["waypoints"][0][:2]
    assert first[2] > before["trajectory"]["waypoints"][0][2]
    assert others == before["trajectory"]["waypoints"][1:]
    (box,) = tables["environment"]["terrain"]["box"]
    assert {**box, "position": [4.0, 4.0]} == {**before["environment"]["terrain"]["box"][0], "heading": 0.0}
    assert box["position"][0] > 4.0
    assert tables["vehicle"]["initial_position"][0] > 0.0
    assert tables["effects"]["wind_constant"]["velocity"][1] > 0.0


def test_user_places_and_removes_fences_buildings_and_waypoints(start, tmp_path):
    write_scene("mine", tmp_path)
    studio = start(tmp_path)
    with chromium.Browser(f"{studio.address}scenes/mine.toml", (1280, 900)) as browser:
        user, mouse = User(browser), Mouse(browser)
        for tool, dx, dy in (("in", 0, 30), ("out", 40, -40), ("tower", -120, 10)):
            mouse.click(f"[data-tool={tool}]")
            mouse.click("#map", dx, dy)
        before = changed_tables(user, 3, "cylinder")
        assert len(before["fence"]["keep_in"][0]["corners"]) == 4
        mouse.drag("#map circle.fence.out:not(.edge)", 20, 0)
        mouse.drag("#map circle.edge.fence.out", 20, 0)
        mouse.drag("#map circle.between.fence.in", 0, 10)
        mouse.click("#map circle.building", count=2)
        mouse.click("#map circle.waypoint", count=2)
        after = changed_tables(user, 3, "waypoints")
        assert browser.errors == []
    (old,), (new,) = before["fence"]["keep_out"], after["fence"]["keep_out"]
    assert (new["position"] != old["position"], new["radius"] > old["radius"]) == (True, True)
    assert len(after["fence"]["keep_in"][0]["corners"]) == 5
    assert "environment" not in after
    assert after["trajectory"]["waypoints"] == [[6.0, 0.0, 3.0], [6.0, 4.0, 4.0]]


def test_form_stays_if_added_effect_does_not_fit(start, tmp_path):
    studio = start(tmp_path)
    page = studio.page("scenes/hover?add=effects.wind_constant")
    assert 'name="effects.wind_constant.velocity" value="[0.0, 0.0, 0.0]"' in page
    status, page, _ = studio.request("scenes/hover?add=effects.wind_constant&add=effects.gravity_altitude")
    assert (status, 'name="effects.wind_constant.velocity"' in page) == (422, True)
    assert "effects.gravity_altitude: cannot be combined with effects.gravity" in page

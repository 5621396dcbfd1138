"""3D view: recorded page and its player in a browser."""

import copy
import json
import re

import numpy as np
import pytest
import rich
from flights_in_space import READY, TICKS, fleet, flight

from lapwing.flights.flight_data import FlightData
from lapwing.flights.topic_view import TopicView
from lapwing.views.report import write
from lapwing.views.view3d import headless as chromium
from lapwing.views.view3d.local_server import run_server
from lapwing.views.view3d.recording import page as view_page

pytest.importorskip("viser", reason="needs viser (pip install lapwing[view3d])")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    return write(flight(), tmp_path_factory.mktemp("page") / "flight.html", view3d=True)


def embedded(page):
    """Return the page of the 3D view within a report."""
    text = page.read_text(encoding="utf-8").partition('id="space"')[2]
    return json.loads(re.search(r'<script type="application/json">(".*?")</script>', text)[1])


def test_page_is_self_contained_and_small(page):
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"<(script|link|img|iframe)[^>]+(src|href)=\"http", text)
    assert text.index('id="space"') < text.index('id="position"')
    assert len(text) < 5_000_000


def test_names_of_scene_cannot_end_script(tmp_path):
    values = fleet()
    values.others[0].vehicle = "</script><script>alert(1)</script>"
    values.fleet = {values.others[0].vehicle: values.others[0].truth, values.vehicle: values.truth}
    text = write(values, tmp_path / "flight.html", view3d=True).read_text(encoding="utf-8")
    assert "<script>alert(1)" not in text
    assert "<script>alert(1)" not in embedded(tmp_path / "flight.html")


def test_report_without_viser_names_extra(tmp_path, monkeypatch):
    monkeypatch.setattr("lapwing.views.view3d.available", lambda: False)
    text = write(flight(), tmp_path / "flight.html", view3d=True).read_text(encoding="utf-8")
    assert "pip install lapwing[view3d]" in text


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_browser_follows_vehicle_and_seeks(tmp_path, page):
    path = tmp_path / "view.html"
    path.write_text(embedded(page), encoding="utf-8")
    with chromium.Browser(path) as browser:
        shown, seen, onboard, place = browser.run(
            READY
            + """
            const camera = () => lapwingView.camera();
            lapwingView.seek(2.5);
            await until(() => Math.abs(lapwingView.time - 2.5) < 0.01);
            await until(() => Math.abs(camera().target[1] - 2.5) < 0.05);  // y is up in three.js
            const followed = camera();
            lapwingView.look("onboard");
            const far = ({ place, target }) => Math.hypot(target[0] - place[0], target[2] - place[2]);
            await until(() => far(camera()) > 15);
            return [lapwingView.time, followed.target, camera().target, camera().place];
            """
        )
        assert browser.errors == []
    assert shown == pytest.approx(2.5, abs=0.01)
    assert seen == pytest.approx([0.0, 2.5, 0.0], abs=0.05)
    assert onboard[1] == pytest.approx(2.5, abs=0.1)  # along x of the body, which is level
    assert np.hypot(onboard[0], onboard[2]) == pytest.approx(20.0, abs=0.1)
    assert np.dot(np.subtract(onboard, place), onboard) > 0.0


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_browser_links_view_to_plots(page):
    with chromium.Browser(page) as browser:
        played, sought, cursor = browser.run(
            """
            const until = async (holds) => {
              for (let k = 0; k < 1200 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
              if (!holds()) throw new Error(`never: ${holds}`);
            };
            await until(() => document.readyState === "complete");
            const space = document.querySelector("#space .space");
            space.closest("details").open = true;
            space.scrollIntoView();
            await until(() => Number(space.dataset.time) > 0.1);
            const played = Number(space.dataset.time);
            space.querySelector("iframe").contentWindow.postMessage({ lapwing: "seek", time: 2.5 }, "*");
            await until(() => Math.abs(Number(space.dataset.time) - 2.5) < 0.01);
            const sought = Number(space.dataset.time);
            const figure = document.querySelector("#position figure");
            figure.scrollIntoView();
            await until(() => figure.querySelector(".js-plotly-plot"));
            const view = space.querySelector("iframe").contentWindow;
            await until(() => {
              view.postMessage({ lapwing: "seek", time: 1 + Math.random() / 100 }, "*");
              return figure.querySelector(".hoverlayer text");
            });
            return [played, sought, figure.querySelector(".hoverlayer").textContent];
            """
        )
        assert browser.errors == []
    assert 0.1 < played < 4.0
    assert sought == pytest.approx(2.5, abs=0.01)
    assert re.match(r"(0\.99|1|2\.5)\S* s", cursor)


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_view_opens_at_event_that_was_chosen_before(page):
    with chromium.Browser(page) as browser:
        time = browser.run(
            """
            const until = async (holds) => {
              for (let k = 0; k < 1200 && !holds(); k++) await new Promise((done) => setTimeout(done, 50));
              if (!holds()) throw new Error(`never: ${holds}`);
            };
            await until(() => document.readyState === "complete");
            const event = document.createElement("button");
            event.dataset.time = 2.5;
            document.body.append(event);
            event.click();
            const space = document.querySelector("#space .space");
            space.closest("details").open = true;
            await until(() => Math.abs(Number(space.dataset.time) - 2.5) < 0.01);
            return Number(space.dataset.time);
            """
        )
        assert browser.errors == []
    assert time == pytest.approx(2.5, abs=0.01)


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_bar_follows_player_less_often_than_trail_and_body(tmp_path, page):
    path = tmp_path / "view.html"
    path.write_text(embedded(page), encoding="utf-8")
    with chromium.Browser(path) as browser:
        bars, seconds, apart = browser.run(
            READY
            + """
            const slider = () => Number(document.querySelector("[role=slider]").getAttribute("aria-valuenow"));
            lapwingView.seek(0.5);
            await until(() => Math.abs(lapwingView.time - 0.5) < 0.01);
            document.activeElement.blur();
            dispatchEvent(new KeyboardEvent("keydown", { code: "Space" })); // plays again
            const bars = new Set(), start = performance.now();
            let apart = 0, before = 0.5;
            while (lapwingView.time < 3.0) {
              await new Promise(requestAnimationFrame);
              bars.add(slider());
              const { z } = __viserMutable.nodeRefFromName["/0 drone1/0 drone1"].position;
              apart = Math.max(apart, Math.abs(lapwingView.time - z) - Math.abs(z - before)); // one image late at most
              before = z;
            }
            return [bars.size, (performance.now() - start) / 1000, apart];
            """
        )
        assert browser.errors == []
    assert bars <= 10.0 * seconds + 3
    assert apart < 0.05  # [m] at 1 m/s: one frame of the recording


@pytest.mark.long
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium")
def test_fleet_is_drawn_in_few_calls_and_only_on_change(tmp_path):
    first = flight()
    for k in range(1, 8):
        truth = {name: first.truth[name] for name in first.truth.fields}
        truth["pose.position"] = first.truth.position + np.array([-2.0 * k, 0.02 * k, 0.0])
        first.others += (FlightData({"ground_truth": TopicView(np.arange(TICKS) * 10**7, truth)}, first.origin),)
    first.others = tuple(copy.copy(other) for other in first.others)
    for k, other in enumerate(first.others):
        other.vehicle = f"vehicle {k + 2}"
    first.fleet = {one.vehicle: one.truth for one in (first, *first.others)}
    path = tmp_path / "view.html"
    path.write_text(view_page([first], [first.vehicle]), encoding="utf-8")
    with chromium.Browser(path, size=(960, 540)) as browser:
        calls, trail, names, frames, seconds, after = browser.run(
            READY
            + """
            lapwingView.seek(1.0);
            await until(() => Math.abs(lapwingView.time - 1.0) < 0.01);
            const wait = (time) => new Promise((done) => setTimeout(done, time));
            const still = async () => { // until no frame has been drawn for half a second
              for (let k = 0, before = -1; k < 200; k++) {
                const now = lapwingView.frames();
                if (now === before) return;
                before = now;
                await wait(500);
              }
            };
            await still();
            const ends = () => {
              const result = [];
              __viserMutable.nodeRefFromName["/0 drone1/trail"].traverse(({ geometry }) => {
                const last = geometry?.instanceCount - 1, end = geometry?.attributes.instanceEnd;
                if (end) result.push([geometry.instanceCount, end.getX(last), end.getY(last), end.getZ(last)]);
              });
              return result;
            };
            const early = ends();
            const tree = __viserSceneTree.getState();
            const names = Object.keys(tree).filter((name) => name.endsWith("/label") && tree[name].effectiveVisibility);
            const calls = __viserTestpoints.rendererInfo.render.calls;
            const begin = lapwingView.frames(), start = performance.now();
            await wait(4000);
            const frames = lapwingView.frames() - begin, seconds = (performance.now() - start) / 1000;
            lapwingView.seek(3.0);
            await until(() => Math.abs(lapwingView.camera().target[1] - 3.0) < 0.05);
            await until(() => Math.abs(ends()[0][3] - 3.0) < 0.01);
            return [calls, [...early, ...ends()], names.length, frames, seconds, lapwingView.frames() - begin - frames];
            """
        )
        assert browser.errors == []
    assert calls < 80
    assert np.array(trail) == pytest.approx(
        np.array([(1, 0, 0, 1), (1, 0, 0, 3)]), abs=0.01
    )  # one piece, up to the time
    assert 1 <= names < 8  # covered labels are hidden
    assert frames <= 2.0 * seconds  # of 60 per second; viser draws one per second, with late ones on a busy machine
    assert after > 0


def test_message_that_viser_prints_late_is_dropped(capsys):
    with run_server():
        pass
    rich.print("[bold](viser)[/bold] Server stopped")
    rich.print("another message")
    assert capsys.readouterr().out == "another message\n"

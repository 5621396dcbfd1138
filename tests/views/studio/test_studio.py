"""`lapwing studio` as a process: access, forms, runs and flights by HTTP."""

import json
import re
import socket
import subprocess
import sys
import tomllib
from http.client import HTTPConnection

import pytest

from lapwing.cosim.log import LogReader
from lapwing.runs.resimulate import recorded_config
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.views.studio import recent_flights

pytest.importorskip("starlette", reason="needs starlette (pip install lapwing[studio])")
pytest.importorskip("uvicorn", reason="needs uvicorn (pip install lapwing[studio])")

pytestmark = pytest.mark.long

QUICK = {"speed": "max", "run.duration": "1.5", "success.require": "[]"}
EVIL = "<script>alert(1)<"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("studio")
    own = (
        (SHIPPED / "hover.toml")
        .read_text()
        .replace('"hover: up', f'"{EVIL}/script>')
        .replace('"climb"', f'"{EVIL}/b>"')
    )
    (path / "mine.toml").write_text(own)
    (path / "pyproject.toml").write_text("[project]\n")
    return path


@pytest.fixture(scope="module")
def studio(start, folder):
    return start(folder)


def test_page_needs_its_secret_its_host_and_its_origin(studio):
    status, text, headers = studio.request("")
    assert status == 200
    assert "delivery_mission" in text
    assert headers["Referrer-Policy"] == "same-origin"
    assert headers["Content-Security-Policy"].startswith("default-src 'self'")
    assert not re.search(r'<(script|link|img|iframe)[^>]+(src|href)="http', text)
    port = studio.origin.rpartition(":")[2]
    assert studio.request(f"http://localhost:{port}/{studio.token}/")[0] == 200
    for path in ("", "/", "/static/studio.css", f"/{'x' * 22}/", "/favicon.ico"):
        assert studio.request(f"{studio.origin}{path}")[0] == 404
    for host in ("example.org", f"example.org:{port}", "127.0.0.1"):
        assert studio.request("", Host=host)[0] == 403
    for origin in ("http://example.org", "null", f"https://127.0.0.1:{port}"):
        assert studio.request("", Origin=origin)[0] == 403
        assert studio.request("scenes/hover/preview", b"run.seed=2", Origin=origin)[0] == 403
    assert studio.request("scenes/hover/preview", b"run.seed=2")[0] == 403  # browsers name the origin of a form


def test_server_listens_on_this_machine_only(studio):
    port = int(studio.origin.rpartition(":")[2])
    others = [info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)]
    for address in {*others, "127.0.0.2"} - {"127.0.0.1"}:
        with pytest.raises(OSError), socket.create_connection((address, port), 5.0):
            pass


def test_uploads_and_large_requests_are_rejected(studio):
    target, own = "scenes/hover/preview", {"Origin": studio.origin}
    assert studio.request(target, b"x", Content_Type="multipart/form-data; boundary=b", **own)[0] == 415
    host, port = studio.origin.removeprefix("http://").split(":")
    lines = [f"POST /{studio.token}/{target} HTTP/1.1", f"Host: {host}:{port}", f"Origin: {studio.origin}"]
    with socket.create_connection((host, int(port))) as connection:  # rejected before its body is sent
        connection.sendall("\r\n".join([*lines, "Content-Length: 1000001", "", ""]).encode())
        assert connection.recv(1 << 12).startswith(b"HTTP/1.1 413 ")


def test_files_outside_folder_are_not_served(studio, folder):
    for path in (
        "flights/..%2fmine.toml",
        "flights/..%2Fmine.toml/report",
        "flights/%2Fetc%2Fpasswd",
        "static/..%2Fguard.py",
        "static/pages.py",
        "scenes/..%2Fmine",
        "scenes/pyproject.toml",
        "compare/report?flight=../mine.toml&flight=/etc/passwd",
        "runs/99",
    ):
        status, text, _ = studio.request(path)
        assert status == 404, path
        assert "root:" not in text


def test_names_of_scenes_are_escaped(studio):
    for path in ("", "scenes/mine.toml"):
        text = studio.page(path)
        assert EVIL not in text
        assert "&lt;script&gt;alert(1)" in text
    text = studio.request("?q=%3Cscript%3Ealert(1)")[1]
    assert "<script>alert(1)" not in text


def test_form_shows_units_ranges_and_help(studio):
    text = studio.page("scenes/delivery_mission")
    field = text.partition('data-key="effects.random_wind_force.sigma"')[2].partition('class="fault"')[0]
    assert 'value="1.0"' in field
    assert '<span class="unit">m/s</span>' in field
    assert "of each axis; 0 to 30" in field
    assert "content of the file that <code>vehicle.airframe</code> names" in text
    assert "`" not in text


def test_titles_of_scenes_show_code_without_backticks(studio):
    text = studio.page("")
    assert "for <code>lapwing tune --from</code>" in text
    assert "`" not in text


def test_search_finds_scenes_by_title(studio):
    text = studio.page("?q=laser+rangefinder")
    assert "scenes/bridge" in text
    assert "scenes/hover" not in text


def test_preview_names_command_python_and_faults(studio):
    answer = json.loads(studio.request("scenes/hover/preview", {"run.seed": "2", "speed": "2", "view": "yes"})[1])
    assert answer["command"] == "lapwing run hover --set run.seed=2 --speed 2 --view"
    assert "lapwing.fly('hover', {\n    'run.seed': 2,\n})" in answer["python"]
    assert (answer["changed"], answer["faults"], answer["error"]) == (["run.seed"], {}, "")
    assert tomllib.loads(answer["toml"]) == {"run": {"seed": 2}}
    answer = json.loads(studio.request("scenes/hover/preview", {"run.duration": "-1"})[1])
    assert answer["faults"] == {"run.duration": "expected a number above 0 and at most 1e+06 [s], got -1.0"}


def test_date_of_a_flight_is_that_in_the_name_of_its_log():
    recorded = recent_flights._recorded
    assert recorded("hover_2026-01-02T03-04-05", 0) == "2026-01-02 03:04:05"
    assert recorded("hover", 10**18)[:7] == "2001-09"


def preview(studio, scene, fields):
    return json.loads(studio.request(f"scenes/{scene}/preview", fields)[1])


def test_preview_names_values_of_an_added_effect_once(studio):
    added = {"add": "effects.wind_constant"}
    answer = preview(studio, "hover", {**added, "effects.wind_constant.velocity": "[3.0, 0.0, 0.0]", "speed": "1"})
    velocity = "effects.wind_constant.velocity"
    assert answer["command"] == f"lapwing run hover --set '{velocity}=[3.0, 0.0, 0.0]' --speed 1"
    assert answer["python"].count("wind_constant") == 1
    assert answer["warnings"][0].startswith("effects.wind_constant does not move the vehicle")
    assert "wind_constant={velocity = [0.0, 0.0, 0.0]}" in preview(studio, "hover", added)["command"]


def test_change_with_a_unit_returns_to_its_field(studio):
    page = studio.page('scenes/hover?set=run.duration="90+s"')
    assert re.search(r'<input[^>]+name="run.duration"[^>]+value="90 s"', page)
    assert preview(studio, "hover", {"run.duration": "90 s"})["faults"] == {}


def test_effect_or_sensor_is_switched_off(studio):
    page = studio.page("scenes/delivery_mission?set=effects.random_wind_force%3Dfalse")
    assert re.search(r'name="effects.random_wind_force" value="false" checked', page)
    off = {"effects.random_wind_force": "false", "effects.random_wind_force.mean": "[1.0, 0.0, 0.0]"}
    answer = preview(studio, "delivery_mission", off)
    assert (answer["error"], answer["faults"]) == ("", {})
    assert answer["command"] == "lapwing run delivery_mission --set effects.random_wind_force=false"
    assert tomllib.loads(answer["toml"]) == {"effects": {"random_wind_force": False}}


def test_preview_has_the_path_of_a_trajectory_of_phases(studio):
    ((start, *_, end),) = preview(studio, "delivery_mission", {})["paths"]
    assert start[:2] == [0.0, 0.0]
    assert end == pytest.approx([10.0, 10.0, start[2]], abs=0.3)
    assert len(preview(studio, "fleet", {})["paths"]) == 3


def test_faulty_form_is_returned_with_fault(studio):
    status, text, _ = studio.request("scenes/hover/run", {**QUICK, "run.seed": "-3"})
    assert status == 422
    assert 'value="-3"' in text
    assert "got -3" in text.partition('data-key="run.seed"')[2].partition("data-key")[0]
    assert studio.request("scenes/hover/run", {**QUICK, "speed": "1; rm -rf /"})[0] == 422


@pytest.fixture(scope="module")
def flown(studio):
    """Return the pages of two runs of hover, the second with another seed and height."""
    pages = []
    for number, changed in enumerate(({}, {"run.seed": "2", "trajectory.phase.0.z.to": "1.5"}), 1):
        status, _, headers = studio.request("scenes/hover/run", {**QUICK, **changed})
        assert (status, headers["Location"]) == (303, f"/{studio.token}/runs/{number}")
        assert "hover is running" in studio.page("") or '"running":false' in studio.page(f"runs/{number}/state")
        pages.append(studio.wait(number))
    return pages


def logs(folder):
    return sorted(path.name for path in (folder / "recordings").glob("*.mcap"))


def test_run_shows_outcome_command_and_report(studio, folder, flown):
    assert "lapwing run hover --set trajectory.phase.0.z.to=1.5 --set run.seed=2 " in flown[1]
    assert "Change and run again" in flown[1]
    assert 'class="outcome' in flown[1]
    with LogReader(folder / "recordings" / logs(folder)[1]) as log:
        config = recorded_config(log)
    assert config.seed == 2
    assert config.resolved["trajectory"]["phase"][0]["z"][0]["to"] == 1.5
    assert '/scenes/hover">Open the scene' in studio.page(f"flights/{logs(folder)[1]}")
    status, text, headers = studio.request(f"flights/{logs(folder)[1]}/report")
    assert status == 200
    assert "flight report" in text
    assert headers["Content-Security-Policy"].startswith("sandbox allow-scripts")


def test_form_of_another_flight_has_changes(studio, flown):
    link = re.search(r'href="(http://[^"]+|/[^"]+)">Change and run again', flown[1])[1].replace("&amp;", "&")
    text = studio.page(link.removeprefix(f"/{studio.token}/"))
    field = text.partition('data-key="run.seed"')[2].partition("</div>")[0]
    assert 'value="2"' in field


def test_cards_of_flights_have_picture_and_outcome(studio, folder, flown):
    home = studio.page("")
    for name in logs(folder):
        assert f"flights/{name}/card" in home
        card = studio.page(f"flights/{name}/card")
        assert "<polyline" in card
        assert f"· {name}<" in card
        assert "timed out" in card or "completed" in card
    assert logs(folder)[0] in studio.page("?q=hover+" + ("timed" if "timed out" in card else "completed"))
    assert logs(folder)[0] not in studio.page("?q=hover+crashed")


def test_finished_logs_are_found_by_cards_that_load_at_the_same_time(start, tmp_path):
    logs = tmp_path / "recordings"
    logs.mkdir()
    for number in range(4):
        (logs / f"{number}.mcap").write_text("no log")
    (logs / "starts.mcap").touch()
    studio = start(tmp_path)
    assert "0.mcap" in (home := studio.page(""))
    assert "starts.mcap" not in home
    host = studio.origin.removeprefix("http://")
    for _ in range(20):
        clients = [HTTPConnection(host, timeout=300.0) for _ in range(40)]
        for number, client in enumerate(clients):
            client.request("GET", f"/{studio.token}/flights/{number % 4}.mcap/card")
        assert {client.getresponse().status for client in clients} == {200}


def test_comparison_names_differences_of_flights(studio, folder, flown):
    query = "&".join(f"flight={name}" for name in logs(folder)[:2])
    text = studio.page(f"compare?{query}")
    row = re.search(r"run\.seed</th><td>(\d)</td><td>(\d)</td>", text)
    assert row.groups() == ("1", "2")
    assert "run.seed" in studio.page(f"compare/report?{query}")
    assert studio.request(f"compare?flight={logs(folder)[0]}")[0] == 422


def test_broken_log_has_card_with_its_fault(studio, folder, flown):
    broken = folder / "recordings" / "broken.mcap"
    broken.write_text("no log")
    assert "not an MCAP file" in studio.page("flights/broken.mcap/card")
    assert studio.request("flights/broken.mcap/report")[0] == 422
    broken.unlink()


def test_scene_of_folder_is_flown_by_its_path(studio):
    status, _, headers = studio.request("scenes/mine.toml/run", QUICK)
    assert status == 303
    number = int(headers["Location"].rpartition("/")[2])
    text = studio.wait(number)
    assert "lapwing run mine.toml" in text
    assert 'class="outcome' in text
    assert EVIL not in text


def test_second_run_waits_for_end_of_first(studio):
    status, _, headers = studio.request("scenes/hover/run", {"speed": "1", "run.duration": "100"})
    number = int(headers["Location"].rpartition("/")[2])
    status, text, _ = studio.request("scenes/hover/run", QUICK)
    assert status == 422
    assert f"run {number} of hover is still running; stop it first" in text
    assert studio.request(f"runs/{number}/stop", {})[0] == 303
    studio.wait(number)


def test_interrupted_studio_ends_its_run_and_its_files(start, tmp_path):
    studio = start(tmp_path)
    studio.request("scenes/hover/run", {"speed": "1"})
    code, rest = studio.stop()
    assert code == 130
    assert "Traceback" not in rest
    with pytest.raises(OSError):
        studio.request("")


def test_port_in_use_is_rejected_in_one_line(tmp_path):
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        command = [sys.executable, "-m", "lapwing", "studio", "--port", str(port)]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
    message = f"lapwing: --port {port}: address already in use; choose another\n"
    assert (result.returncode, result.stderr) == (2, message)


def test_missing_extra_is_named_in_one_line(monkeypatch):
    from lapwing.views import studio as package

    monkeypatch.setattr(package.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"pip install lapwing\[studio\]"):
        package.require()

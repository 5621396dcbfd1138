"""Commands that print: protocol, schemas, advice."""

import json

import pytest

from lapwing.runs.multi_process_run import Clock
from lapwing.runs.observer import Elapsed, Silent
from lapwing.services.scene_resolver import load, resolve
from tests.commands import assert_rejected


def test_protocol_lists_services_ports_and_columns(lapwing):
    code, out, _ = lapwing("protocol", "hover")
    assert code == 0
    assert "\nplant\n" in out
    assert "output truth, every tick" in out


def test_json_and_picture_are_written(lapwing, tmp_path):
    assert lapwing("protocol", "hover", "--json", "p.json", "--plot", "p.png") == (0, "", "")
    assert "plant" in json.loads((tmp_path / "p.json").read_text())["services"]
    assert (tmp_path / "p.png").read_bytes().startswith(b"\x89PNG")


def test_missing_folder_is_one_line(lapwing):
    assert_rejected(lapwing("protocol", "hover", "--plot", "none/p.png"), "none/p.png: cannot be written")


@pytest.mark.parametrize("kind", ["scene", "airframe", "gains"])
def test_schema_is_json(lapwing, tmp_path, kind):
    code, out, _ = lapwing("schema", kind)
    assert code == 0
    assert json.loads(out)["type"] == "object"
    assert lapwing("schema", kind, "--out", tmp_path / "schema.json") == (0, "", "")
    assert (tmp_path / "schema.json").read_text() == out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["scnee"], "KIND: unknown kind of file 'scnee'; did you mean scene? expected one of airframe, gains, scene"),
        (["--out", "-"], "-: standard output is not supported here; expected the path of an output"),
        (["--out", "none/page.json"], "none/page.json: cannot be written"),
    ],
)
def test_schema_rejects_bad_arguments_in_one_line(lapwing, arguments, message):
    assert_rejected(lapwing("schema", *arguments), message)


@pytest.mark.parametrize(
    ("wall", "block_times", "text"),
    [
        (20.0, {"plant": 1.5, "autopilot": 0.5}, "the same bits in about 2.0 s instead of 20.0 s"),
        (3.0, {"plant": 0.2, "autopilot": 0.1}, ""),  # short
        (20.0, {"plant": 9.0, "autopilot": 2.0}, ""),  # one process is hardly faster
        (20.0, {"plant": 1.5}, ""),  # unknown
    ],
)
def test_slow_flight_in_processes_advises_single_process(wall, block_times, text):
    clock = Clock(Silent(), resolve(load("hover")))
    clock.elapsed = Elapsed(17.0, wall)
    clock._block_times = block_times
    assert clock.faster_mode(["plant", "autopilot"]).removeprefix("--mode single-process: ") == text

"""`lapwing protocol`: ports between services as text, JSON or a picture."""

import json


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
    code, _, err = lapwing("protocol", "hover", "--plot", "none/p.png")
    assert code == 2
    assert err.count("\n") == 1
    assert "none/p.png: cannot be written" in err

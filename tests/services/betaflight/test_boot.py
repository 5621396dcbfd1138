"""Start of Betaflight with a scripted command line."""

import pytest

from lapwing.services.betaflight import boot
from lapwing.services.betaflight.boot import lines
from lapwing.services.common.firmware.program import FirmwareError
from lapwing.services.scene_resolver import load, resolve


class CommandLine:
    """Scripted command line with a prompt; the first `lost` attempts to enter it fail."""

    def __init__(self, lost=0, rejects=""):
        self._lost, self._rejects, self._answer = lost, rejects, ""
        self.received = []

    def send(self, data):
        self.received.append(data.decode())
        if data == b"#" and self._lost:
            self._lost -= 1
        elif self._rejects and self._rejects in data.decode():
            self._answer = "###ERROR IN set: INVALID NAME###\r\n# "
        elif data != b"save\n":
            self._answer = "answer\r\n# "

    def text(self):
        result, self._answer = self._answer, ""
        return result

    def close(self):
        pass


class Running:
    """Program that ends immediately after `save`."""

    pid = 1
    running = False

    def check(self, when):
        pass


def configure(monkeypatch, line, overrides=()):
    monkeypatch.setattr(boot, "connect", lambda *_: line)
    monkeypatch.setattr(boot, "REPEAT", 0.0)
    config = resolve(load("betaflight_quad", list(overrides))).services["betaflight"].parameters
    boot.configure(config, Running(), lambda text: None)
    return config


def test_lost_entry_to_command_line_is_repeated(monkeypatch):
    line = CommandLine(lost=2)
    config = configure(monkeypatch, line)
    assert line.received[:4] == ["#", "#", "#", "version\n"]
    assert line.received[4:] == [*(f"{text}\n" for text in lines(config)), "save\n"]


def test_lines_of_scene_come_last():
    config = resolve(load("betaflight_quad", ["autopilot.parameters={thrust_linear=20}"]))
    assert lines(config.services["betaflight"].parameters)[-1] == "set thrust_linear = 20"


def test_rejected_line_is_reported(monkeypatch):
    with pytest.raises(FirmwareError, match=r"rejects the line 'set no_such = 1' .*check autopilot.parameters"):
        configure(monkeypatch, CommandLine(rejects="no_such"), ["autopilot.parameters={no_such=1}"])

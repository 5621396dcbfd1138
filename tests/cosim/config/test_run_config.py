"""Run configurations: resolution, text, compressed form, provenance."""

import subprocess
import zlib

import pytest

from lapwing.cosim.config import provenance
from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.config.serialise import LARGEST, compress, decompress, digest, first_difference, from_json, to_json
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.services.scene_resolver import load, resolve
from tests.cosim.small_graph import config_of
from tests.golden.cases import CASES


@pytest.mark.parametrize("name", CASES)
def test_run_configuration_of_each_scene_round_trips(name):
    config = CASES[name].resolve()
    text = to_json(config)
    again = from_json(text)
    assert type(again) is type(config)
    assert first_difference(config, again) is None
    assert to_json(again) == text
    assert digest(again) == digest(config)


def test_resolution_is_deterministic_and_overrides_change_it():
    def resolved(*overrides):
        return resolve(load("hover", [*overrides]))

    assert digest(resolved()) == digest(resolved())
    assert first_difference(resolved(), resolved("run.seed=7"))[0] == "seed"
    path, before, after = first_difference(resolved(), resolved("airframe.mass.total=9.5"))
    assert path == "services.autopilot.parameters.airframe.mass"
    assert after == 9.5 != before


def test_port_and_producer_are_found_by_name():
    port = Port("wind", (0.0, 0.0), 5)
    config = config_of((port,))
    assert config.port("wind") == port
    assert config.producers == {"wind": "test"}
    assert (config.interval, config.duration) == (0.01, 100.0)
    with pytest.raises(LockStepError, match=r"^no service of this scene publishes rain$"):
        config.port("rain")


def test_order_of_services_follows_ports():
    services = {
        "controller": ServiceConfig(None, (InputPort("wind"),), ()),
        "weather": ServiceConfig(None, (), (Port("wind", 0.0),)),
    }
    assert config_of()._replace(services=services).order == ["weather", "controller"]


def test_compressed_run_configuration_is_exact():
    config = resolve(load("hover"))
    assert decompress(compress(config)) == to_json(config)
    assert decompress(to_json(config).encode()) == to_json(config)


@pytest.mark.parametrize(
    "message",
    [b"", b"rubbish", b"{\xff", zlib.compress(b"a" * 100)[:-5], zlib.compress(bytes(LARGEST + 1))],
    ids=["nothing", "not packed", "no text", "cut short", "a bomb"],
)
def test_invalid_message_is_rejected(message):
    with pytest.raises(ValueError):
        decompress(message)


@pytest.mark.parametrize("error", [FileNotFoundError("git"), subprocess.TimeoutExpired("git", 60.0)])
def test_run_does_not_need_git(error, monkeypatch):
    """On a machine at a load of 40, git did not answer within 5 s and ended the recorder."""

    def fail(*_arguments, **_options):
        raise error

    provenance.source_commit.cache_clear()
    monkeypatch.delenv("LAPWING_COMMIT", raising=False)
    monkeypatch.setattr(provenance.subprocess, "run", fail)
    assert provenance.source_commit() == "unknown"
    provenance.source_commit.cache_clear()

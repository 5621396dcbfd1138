"""Run configuration: resolution, ports and order of services, and a round trip through text."""

import pytest

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.config.serialise import digest, first_difference, from_json, to_json
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

"""From a scene to a set-up."""

import pytest

from lapwing.cosim.config.serialise import first_difference
from lapwing.cosim.scene import SceneError
from lapwing.services.common.run_schema import SHIPPED
from lapwing.services.scene_resolver import load, reseed, resolve


@pytest.mark.parametrize("scene", sorted(path.stem for path in SHIPPED.glob("*.toml")))
def test_another_seed_is_what_resolving_gives(scene):
    setup = resolve(load(scene))
    assert first_difference(reseed(setup, 4711), resolve(load(scene, ["run.seed=4711"]))) is None
    assert first_difference(reseed(setup, setup.seed), setup) is None


@pytest.mark.parametrize("scene", ["hover", "delivery_mission", "fleet"])
def test_all_services_are_started_again_or_none(scene):
    alone = resolve(load(scene))
    names = list(alone.services)
    every = resolve(load(scene, ["run.restart=true"]))
    assert every.resolved["run"]["restart"] == names
    assert first_difference(every, resolve(load(scene, {"run.restart": names}))) is None
    assert first_difference(resolve(load(scene, ["run.restart=false"])), alone) is None
    assert alone.resolved["run"]["restart"] == []


@pytest.mark.parametrize("value", ["1", "always", '["plant", 1]'])
def test_what_is_neither_all_nor_a_list_of_services_is_refused(value):
    with pytest.raises(SceneError, match=r"run.restart.*expected true, false or a list"):
        load("hover", [f"run.restart={value}"])

"""Edits of an effect that a scene does not use do not recompile its kernel; tests share those of shipped scenes."""

import numba
import pytest

from lapwing.cosim.diagram.compiled_block import advance
from lapwing.dynamics import effects
from lapwing.kernels.compiler.cache_key import key
from lapwing.kernels.compiler.source_digest import _all
from lapwing.services.process_table import create
from lapwing.services.scene_resolver import load, resolve
from tests.combinations import MISSION

SHARED = {"lapwing.dynamics.effects.payload_release"}  # the mass of a load is an input of every scene


def test_plant_sources_contain_named_effects_only():
    block = create(resolve(load("hover")), "plant").blocks[0]
    made_of = key(advance, (numba.typeof(block.parameters), numba.typeof(block.state)), None, ())
    reached = {f"lapwing.dynamics.effects.{name}" for name in effects.names()} & _all(made_of.modules)
    assert reached - SHARED == {
        f"lapwing.dynamics.effects.{name}" for name in ("gravity", "ground_contact", "rotor_thrust")
    }


@pytest.mark.parametrize(
    ("effect", "scene"),
    [(None, "delivery_mission"), ("battery", "groundstation"), ("payload_release", "delivery_full")],
)
def test_combination_of_tests_has_plant_of_shipped_scene(effect, scene):
    overrides = [*MISSION, f"effects.{effect}={{}}"] if effect else MISSION
    one, other = (create(resolve(load(*each)), "plant").blocks[0] for each in (("hover", overrides), (scene,)))
    for kind in ("parameters", "state"):
        assert numba.typeof(getattr(one, kind)) == numba.typeof(getattr(other, kind))

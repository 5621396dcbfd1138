"""What the plant's kernel is kept for: an edit of an effect that the scene does not name compiles nothing anew."""

import numba

from cosim.part import advance
from dynamics import effects
from dynamics.kernel._key import key
from dynamics.kernel._sources import _all
from services.processes import create
from services.table import load, resolve

SHARED = {"dynamics.effects.payload"}  # what hangs below is weighed in any scene


def test_the_sources_of_a_plant_hold_no_effect_that_its_scene_does_not_name():
    part = create(resolve(load("hover")), "plant").parts[0]
    made_of = key(advance, (numba.typeof(part.parameters), numba.typeof(part.state)), None, ())
    reached = {f"dynamics.effects.{name}" for name in effects.names()} & _all(made_of.modules)
    assert reached - SHARED == {f"dynamics.effects.{name}" for name in ("gravity", "ground_contact", "rotor_thrust")}

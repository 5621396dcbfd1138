"""The compiled closed loop gives the services' numbers to the last bit."""

from pathlib import Path

import numpy as np
import pytest

from services.scene import load
from studies.campaign import by_services
from studies.campaign.flight import fly_compiled

SCENES = Path(__file__).parents[3] / "scenes"


@pytest.mark.parametrize(
    ("scene", "overrides"),
    [
        ("delivery_mission", ["run.seed=7"]),
        ("delivery_mission", ["exchange.coupling=parallel"]),
        ("delivery_mission", ["sensors.gps.preset=standard"]),
        ("hover", []),
    ],
)
def test_same_bits_and_the_same_end(scene, overrides):
    scene = load(SCENES / f"{scene}.toml", overrides)
    (compiled, failed), by_messages = fly_compiled(scene), by_services.fly(scene)
    assert failed == 0
    assert (compiled.finite, compiled.finished) == (by_messages.finite, by_messages.finished) == (True, True)
    for name, column in compiled.record._asdict().items():
        assert np.array_equal(column, getattr(by_messages.record, name)), name

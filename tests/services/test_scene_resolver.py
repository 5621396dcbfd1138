"""Resolution of a scene to a run configuration."""

import pytest

from lapwing.cosim.config.serialise import first_difference
from lapwing.services.common.schemas.run_schema import SHIPPED
from lapwing.services.scene_resolver import load, reseed, resolve


@pytest.mark.parametrize("scene", sorted(path.stem for path in SHIPPED.glob("*.toml")))
def test_reseed_equals_resolving_with_seed(scene):
    config = resolve(load(scene))
    assert first_difference(reseed(config, 4711), resolve(load(scene, ["run.seed=4711"]))) is None
    assert first_difference(reseed(config, config.seed), config) is None

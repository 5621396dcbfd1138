"""Combinations of effects, integrator and vehicle that long tests share.

Each combination is compiled once, other parameters compile nothing. The shipped scenes are compiled for the golden
digests: a test takes one of them, or a combination below. Further combinations belong to `make nightly`.
"""

import pytest

MISSION = [f"effects.{name}={{}}" for name in ("air_density", "gyroscopic_torque", "random_wind_force")]
"""Overrides of `hover` that give it the plant of `delivery_mission`, with `battery` that of `groundstation`, with
`payload_release` that of `delivery_full`. `quad_x`, `bridge` and `racer_250` have one plant."""

NIGHTLY = pytest.mark.nightly


def rest_nightly(*values, keep=1):
    """Return values of a parameter, of which `make nightly` tests all but the first ones."""
    first, rest = values[:keep], values[keep:]
    return [*first, *(pytest.param(*(v if isinstance(v, tuple) else (v,)), marks=NIGHTLY) for v in rest)]

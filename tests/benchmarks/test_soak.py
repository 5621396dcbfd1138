"""Evaluation of samples by `benchmarks.soak`."""

import pytest

from benchmarks.soak import Sample, rows


def samples(slower, dearer):
    """Return 41 samples; in the last quarter, wall time is `slower` and processor time `dearer` by these factors."""
    result, wall, processor = [], 0.0, 0.0
    for k in range(41):
        result.append(Sample(wall, float(k), 1000.0, 90, 40, processor, 0.15 * k))
        late = k >= 30
        wall, processor = wall + 0.1 * (slower if late else 1.0), processor + 0.2 * (dearer if late else 1.0)
    return result


@pytest.mark.parametrize(
    ("slower", "dearer", "short"),
    [
        (1.0, 1.0, []),
        (1.25, 1.0, ["speed, to the first"]),
        (1.0, 1.25, ["processor time", "processor time, to the first"]),
        (0.5, 0.5, []),
    ],
)
def test_run_that_becomes_slow_falls_short(slower, dearer, short):
    result = {row.name.removeprefix("flight: "): row for row in rows(samples(slower, dearer), "flight")}
    assert [what for what, row in result.items() if row.missed] == short
    assert result["speed, to the first"].measured == pytest.approx(1 / slower)
    assert result["processor time, to the first"].measured == pytest.approx(dearer)

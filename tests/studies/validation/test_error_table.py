"""Tables of prediction errors: each cell has one number, complete in a narrow terminal."""

import math

import numpy as np
import pytest
from rich.console import Console

from lapwing.studies.validation.prediction_metrics import FIELDS, Metric
from lapwing.studies.validation.procedure import TrimMemory, Validation
from lapwing.views.studies.study_result import show
from lapwing.views.studies.validation_result import error_table, validation_result


def validation(interval, error=1.234):
    """Return the errors of two horizons: the smallest and largest numbers of letters, and no power."""
    nan = math.nan
    metric = Metric(1.23e-07, *((1.11e-07, 0.000134) if interval else (nan, nan)))
    row = [Metric(nan, nan, nan) if name == "power" else metric for name in FIELDS]
    baselines = {"constant_velocity": [row, row], "linear_fit": [row, row]}
    ratio = Metric(error, *((error * 1.123 / 1.234, error * 1.345 / 1.234) if interval else (nan, nan)))
    ratios = {name: [[ratio if math.isfinite(m.mean) else m for m in row]] * 2 for name in baselines}
    noise = np.zeros((2, len(FIELDS)))
    return Validation(
        "scene", 0.01, (1, 50), TrimMemory(0.15, 10.0), (), (), 44, [row, row], baselines, ratios, noise
    )  # fmt: skip


@pytest.mark.parametrize("interval", [True, False])
def test_every_cell_has_one_complete_number(interval):
    table = error_table(validation(interval))
    heads, rows = [head.replace("\n", " ") for head in table.heads], table.rows
    assert len(rows) == 2 * (len(FIELDS) - 1)
    assert [heads[2:5] == ["plant", "95 % from", "95 % to"], len(heads)] == [interval, 7 if interval else 5]
    assert {len(row) for row in rows} == {len(heads)}
    assert all(math.isfinite(float(cell)) for row in rows for cell in row[2:])
    console = Console(record=True, width=80)
    show(console, validation_result(validation(interval)))
    text = console.export_text()
    assert "…" not in text
    assert text.count("1.23e-07") == 2 * (len(FIELDS) - 1) * 3
    assert text.count("1.23 [1.12, 1.34] worse") == (2 * (len(FIELDS) - 1) * 2 if interval else 0)


@pytest.mark.parametrize("interval", [True, False])
def test_small_ratio_is_not_zero(interval):
    console = Console(record=True, width=80)
    show(console, validation_result(validation(interval, error=0.001)))
    text = console.export_text()
    assert "0.00 " not in text
    assert ("<0.01 [<0.01, <0.01] better" if interval else " <0.01 ") in text
    assert "…" not in text

"""Verdict of a validation: which evidence counts, and what the sentence claims."""

import numpy as np
import pytest
from flight_recordings import INTERVAL, simulated

from lapwing.flights.rotation_arrays import rotation_vector
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.prediction_metrics import FIELDS, Metric, noisier
from lapwing.studies.validation.procedure import TrimMemory, Validation, compare_with_flights
from lapwing.studies.validation.start_states import USUAL_TRIM
from lapwing.studies.validation.verdict import BETTER, OPEN, WORSE, facts, sentence, uses

SCENE = "crazyflie_21"
HORIZONS = (1, 10, 50)


def validation(over_velocity, over_linear, noise=0.0, horizons=HORIZONS, width=0.05):
    """Return a validation with these ratios of errors by field, at all horizons."""

    def rows(values):
        return [[Metric(values[f], values[f] - width, values[f] + width) for f in FIELDS]] * len(horizons)

    one = [[Metric(1.0, 1.0, 1.0)] * len(FIELDS)] * len(horizons)
    ratios = {"constant_velocity": rows(over_velocity), "linear_fit": rows(over_linear)}
    shares = np.full((len(horizons), len(FIELDS)), noise)
    return Validation("scene", 0.01, horizons, TrimMemory(), (), (), 9, one, {}, ratios, shares)


def errors(**values):
    return {field: values.get(field, 0.5) for field in FIELDS}


def test_verdict_names_loops_whose_signals_plant_predicts_better():
    result = validation(errors(), errors(rate=1.2))
    assert uses(result) == {"position loops": BETTER, "attitude loops": BETTER, "rate-loop tuning": WORSE}
    assert sentence(result) == "good enough for position loops and attitude loops, not for rate-loop tuning"
    assert "worse than linear fit: rate after 0.01, 0.1 and 0.5 s" in facts(result)


def test_one_bad_signal_of_a_loop_suffices():
    assert uses(validation(errors(velocity=1.1), errors()))["position loops"] == WORSE


@pytest.mark.parametrize(("over_velocity", "expected"), [(0.1, BETTER), (0.5, WORSE)])
def test_linear_fit_need_not_be_beaten_if_error_is_small(over_velocity, expected):
    assert uses(validation(errors(rate=over_velocity), errors(rate=1.2)))["rate-loop tuning"] == expected


def test_error_at_noise_of_measurements_is_no_evidence():
    result = validation(errors(rate=1.1), errors(rate=1.3), noise=0.9)
    assert uses(result)["rate-loop tuning"] == OPEN
    assert "not shown for rate-loop tuning" in sentence(result)
    assert any(line.startswith("at the noise of the measurements: ") for line in facts(result))


def test_wide_confidence_interval_leaves_verdict_open():
    result = validation(errors(), errors(), width=0.6)
    assert set(uses(result).values()) == {OPEN}
    assert sentence(result) == "these flights do not decide on position loops, attitude loops or rate-loop tuning"


def test_constant_signal_leaves_verdict_open():
    result = validation(errors(rate=np.nan), errors(rate=np.nan))
    assert uses(result)["rate-loop tuning"] == OPEN


def test_use_without_its_horizon_is_not_tested():
    result = validation(errors(), errors(), horizons=(10,))
    assert sentence(result) == "good enough for attitude loops and rate-loop tuning, not tested for position loops"


def test_noise_is_found_in_moving_signals():
    """The noise that is added once more is that of the recording, not its motion."""
    (flight,) = simulated(PlantRows(SCENE, INTERVAL), 6.0, [1])
    added = noisier(flight)
    assert np.std(added.omega - flight.omega) == pytest.approx(1.5e-2, rel=0.2)
    assert np.std(added.velocity - flight.velocity) == pytest.approx(3e-3, rel=0.2)
    assert np.std(rotation_vector(added.attitude) - rotation_vector(flight.attitude)) == pytest.approx(2e-3, rel=0.2)


def test_true_plant_is_never_called_bad_and_wrong_inertia_is():
    flights = simulated(PlantRows(SCENE, INTERVAL), 8.0, [1, 2, 3, 4])
    true, wrong = (
        compare_with_flights(SCENE, PlantRows(SCENE, INTERVAL, overrides), flights, HORIZONS, USUAL_TRIM, 5)
        for overrides in ([], ["airframe.mass.inertia=[6e-4,6e-4,1e-3]"])
    )
    assert WORSE not in uses(true).values()
    assert uses(true)["position loops"] == uses(true)["rate-loop tuning"] == BETTER
    assert uses(wrong)["rate-loop tuning"] == WORSE

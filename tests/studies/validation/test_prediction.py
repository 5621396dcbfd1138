import json
import re
from dataclasses import replace

import numpy as np
import pytest
from flight_recordings import INTERVAL, real_flights, simulated, write_csv
from page_texts import page_text

from lapwing.studies.validation.linear_baseline import linear_fit
from lapwing.studies.validation.plant_rows import PlantRows
from lapwing.studies.validation.prediction_metrics import clusters, constant_velocity, magnitudes, pool, ratios
from lapwing.studies.validation.start_states import NO_TRIM, TrimMemory, start_states
from lapwing.studies.validation.windows import compare, predict, thrust_ratio, window_starts
from tests.commands import assert_rejected, run_command

SCENE = "crazyflie_21"


@pytest.fixture(scope="module")
def plant():
    return PlantRows(SCENE, INTERVAL)


@pytest.fixture(scope="module")
def flights(plant):
    return simulated(plant, 6.0, [1, 2, 3], noise=0.0)


def errors(plant, flight, horizons, memory=NO_TRIM):
    (states,) = start_states(plant, [flight], memory)
    starts = window_starts(flight, horizons[-1], 7)
    return compare(flight, starts, horizons, predict(plant, flight, starts, states, horizons))


def test_own_flight_is_predicted_to_rounding(plant, flights):
    flight = flights[0]
    (states,) = start_states(plant, [flight], NO_TRIM)
    starts = np.arange(200, 400, 7)  # the initial speeds of the rotors no longer matter
    result = compare(flight, starts, (1, 10, 50), predict(plant, flight, starts, states, (1, 10, 50)))
    assert np.abs(result.position).max() < 1e-8
    assert np.abs(result.attitude).max() < 1e-6
    assert np.abs(result.rate).max() < 1e-6


@pytest.mark.long
def test_trim_recovers_constant_force(plant, flights):
    pushed = PlantRows(SCENE, INTERVAL, ["effects.body_wrench.force=[0.02, -0.01, 0.03]"])
    (flight,) = simulated(pushed, 6.0, [4], noise=0.0)
    (states,) = start_states(plant, [flight], TrimMemory(0.2, 1.0))
    assert states.force[0, -2] == pytest.approx([0.02, -0.01, 0.03], abs=2e-3)
    assert np.abs(errors(plant, flight, (50,), TrimMemory(0.2, 1.0)).position).mean() < 0.1 * (
        np.abs(errors(plant, flight, (50,)).position).mean()
    )


def test_trim_uses_no_later_measurement(plant, flights):
    flight = flights[0]
    omega = flight.omega.copy()
    omega[301:] += 5.0
    (before,) = start_states(plant, [flight], TrimMemory(0.2, 1.0))
    (after,) = start_states(plant, [replace(flight, omega=omega)], TrimMemory(0.2, 1.0))
    assert np.array_equal(before.torque[0, :301], after.torque[0, :301])


def test_windows_stay_clear_of_invalid_samples(flights):
    flight = flights[0]
    valid = flight.valid.copy()
    valid[300] = False
    starts = window_starts(replace(flight, valid=valid), 50, 1)
    assert not ((starts >= 250) & (starts <= 320)).any()
    assert {249, 321} <= set(starts.tolist())


def test_constant_velocity_matches_closed_form(flights):
    flight, starts = flights[0], np.array([100, 200])
    result = constant_velocity(flight, starts, (50,))
    expected = flight.position[starts] + 0.5 * flight.velocity[starts] - flight.position[starts + 50]
    assert result.position[:, 0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_thrust_ratio_is_inverse_mass_ratio(plant, flights, factor):
    """Thrust depends on motor commands and motion only, so twice the mass has half the specific force."""
    scene = PlantRows(SCENE, INTERVAL, [f"airframe.mass.total={factor * plant.mass[0]}"])
    (states,) = start_states(scene, flights[:1], NO_TRIM)
    starts = window_starts(flights[0], 1, 5)
    assert thrust_ratio(flights[0], starts, states, True) == pytest.approx(1.0 / factor, rel=0.01)


def test_linear_fit_beats_constant_velocity(flights):
    starts = [window_starts(f, 20, 2) for f in flights]
    fitted = np.mean([np.abs(e.velocity).mean() for e in linear_fit(flights, starts, (20,))])
    held = np.mean(
        [np.abs(constant_velocity(f, s, (20,)).velocity).mean() for f, s in zip(flights, starts, strict=True)]
    )
    assert fitted < 0.5 * held


def test_interval_resamples_flights_not_windows():
    values = np.repeat([1.0, 2.0, 3.0, 4.0], 1000)[:, None, None]
    ((metric,),) = pool(values, np.repeat(np.arange(4), 1000))
    assert metric.mean == pytest.approx(2.5)
    assert metric.low < 1.8
    assert metric.high > 3.2


@pytest.mark.filterwarnings("error")
def test_quantity_without_measurement_has_no_interval():
    ((known, unknown),) = pool(np.array([[[1.0, np.nan]]] * 4), np.arange(4))
    assert known == (1.0, 1.0, 1.0)
    assert np.isnan(unknown).all()


@pytest.mark.parametrize("flights", [3, 5, 20])
def test_intervals_of_few_flights_cover_true_ratio(flights):
    draw = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        hard = draw.normal(0.0, 0.5, flights)  # for plant and baseline alike
        values, baseline = (np.exp(hard + draw.normal(0.0, 0.1, flights))[:, None, None] for _ in range(2))
        ((metric,),) = ratios(values, baseline, np.arange(flights))
        hits += metric.low < 1.0 < metric.high
    assert hits > 180


def test_few_flights_are_resampled_by_blocks_of_time():
    starts = np.arange(0, 1000, 5)
    assert set(clusters([starts] * 2, INTERVAL).tolist()) == set(range(10))
    assert set(clusters([starts] * 8, INTERVAL).tolist()) == set(range(8))


def test_linear_fit_of_single_flight_is_cross_validated(flights):
    """Motion that the commands do not explain is not explained by overfitting."""
    draw = np.random.default_rng(1)
    flight = replace(flights[0], omega=draw.normal(0.0, 1.0, flights[0].omega.shape))
    starts = window_starts(flight, 20, 12)
    (result,) = linear_fit([flight], [starts], (20,))
    assert np.std(result.rate) > 1.0


def test_magnitudes_are_means_over_axes(plant, flights):
    result = errors(plant, flights[0], (10,))
    assert magnitudes(result)[:, 0, 1] == pytest.approx(np.abs(result.velocity[:, 0]).mean(axis=1))


@pytest.mark.long
def test_command_writes_errors_and_baselines(plant, tmp_path):
    paths = [write_csv(tmp_path / f"{f.name}.csv", f) for f in simulated(plant, 4.0, [1, 2, 3])]
    out, page = tmp_path / "errors.json", tmp_path / "page.html"
    done = run_command(
        "validate", SCENE, *paths, "--mapping", "nanobench", "--horizons", "1,50", "--json", out, "--report", page,
        "--stride", "7", "--trim-force", "2", "--trim-torque", "0", "--set", "run.seed=2", code=0)  # fmt: skip
    first, last = json.loads(out.read_text())["horizons"]
    assert (first["steps"], last["steps"]) == (1, 50)
    assert last["windows"] > 50
    assert 0.0 < last["position"] < last["baselines"]["constant_velocity"]["position"]
    assert set(last["baselines"]) == {"constant_velocity", "linear_fit"}
    assert "Errors over the envelope" in page_text(page)
    verdict = json.loads(out.read_text())["verdict"]
    assert verdict["uses"]["position loops"] == "better"
    assert f"{SCENE} on 3 flights, {last['windows']} windows: {verdict['text']}" in done.stdout.splitlines()[0]
    assert "Good enough for position loops" in page_text(page)
    row = next(c for c in verdict["comparisons"] if (c["signal"], c["time"]) == ("velocity", 0.5))
    low, high = row["baselines"]["constant_velocity"]["confidence_95"]
    assert low < last["velocity"] / last["baselines"]["constant_velocity"]["velocity"] < high < 1.0


@pytest.mark.long
def test_flight_of_another_vehicle_is_reported(plant, tmp_path):
    path = write_csv(tmp_path / "mine.csv", simulated(plant, 2.0, [1])[0])
    files = ("--json", tmp_path / "errors.json", "--report", tmp_path / "page.html")
    warning = r"mine: the motor commands produce 0\.(49|50|51) times the measured specific force; check that"
    for heavier, expected in ((), 0), (("--set", f"airframe.mass.total={2.0 * plant.mass[0]}"), 1):
        done = run_command(
            "validate", SCENE, path, "--mapping", "nanobench", "--horizons", "1,50", *files, *heavier, code=0
        )
        assert len(re.findall(f"warning: {warning}", done.stdout)) == expected
        assert len(json.loads((tmp_path / "errors.json").read_text())["warnings"]) == expected
        assert len(re.findall(warning, page_text(tmp_path / "page.html"))) == expected


@pytest.mark.long
def test_repeated_flight_counts_once(plant, tmp_path):
    """An imported log of the same file changes neither errors nor intervals."""
    paths = [write_csv(tmp_path / f"{f.name}.csv", f) for f in simulated(plant, 2.0, [1, 2])]
    copy, options = tmp_path / "copy.mcap", ("--mapping", "nanobench", "--horizons", "1,50")
    run_command("import", paths[0], "--mapping", "nanobench", "--out", copy, code=0)
    results = []
    for files in (paths, [*paths, copy]):
        done = run_command("validate", SCENE, *files, *options, "--json", tmp_path / "errors.json", code=0)
        results.append(json.loads((tmp_path / "errors.json").read_text())["horizons"])
    assert results[0] == results[1]
    assert f"left out: copy: the same flight as {paths[0].stem}" in done.stdout


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--horizons", "50,10"), "--horizons 50,10: expected ascending"),
        (("--mapping", "nowhere"), "--mapping nowhere: unknown"),
        ((), "needs --mapping"),
    ],
)
def test_command_rejects_bad_options(plant, tmp_path, arguments, message):
    path = write_csv(tmp_path / "flight.csv", simulated(plant, 1.0, [1])[0])
    assert_rejected(run_command("validate", SCENE, path, "--json", tmp_path / "out.json", *arguments), message)
    assert not (tmp_path / "out.json").exists()


def test_real_flights_are_predicted_better_than_baseline():
    from lapwing.studies.validation.procedure import validate

    paths = sorted(real_flights("nanobench").glob("B9_trefoil_slow_rep*.csv.gz"))[:4]
    result = validate(SCENE, paths, "nanobench", (10, 50))
    for field in range(4):
        assert result.plant[-1][field].mean < result.baselines["constant_velocity"][-1][field].mean

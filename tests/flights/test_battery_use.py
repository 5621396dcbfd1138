"""Use of the battery against a discharge at constant current."""

import numpy as np
import pytest
import synthetic_flights

from lapwing.flights.battery_use import battery_use
from lapwing.services.scene_resolver import load
from lapwing.studies import simulate
from lapwing.views.report.key_numbers import key_numbers
from lapwing.views.report.plot import NotRecordedError
from lapwing.views.report.plots import battery

TICKS, RATE, CELLS = 361, 10, 4
CURRENT, VOLTAGE, CAPACITY = 20.0, 15.0, 5.0  # [A], [V], [A h]
HOURS = (TICKS - 1) / RATE / 3600.0


def flight(charge=True, **effect):
    """Return a flight of 36 s at 20 A and 15 V: 0.2 A h, 3 W h."""
    t = np.arange(TICKS) / RATE
    truth = {
        "pose.position": np.column_stack([0.0 * t, 0.0 * t, t]),
        "pose.orientation": synthetic_flights.LEVEL,
        "velocity": (0.0, 0.0, 1.0),
        "ground_contact": np.zeros(TICKS, bool),
    }
    left = 0.5 - CURRENT * t / 3600.0 / CAPACITY if charge else np.full(TICKS, np.nan)
    pack = {
        "voltage": VOLTAGE,
        "current": -CURRENT,
        "percentage": left,
        "design_capacity": CAPACITY,
        "cell_voltage": (VOLTAGE / CELLS,) * CELLS,
    }
    scene = {"effects": {"battery": effect}}
    result = synthetic_flights.flight(TICKS, RATE, scene=scene, ground_truth=truth, battery=pack)
    result.digest = "0" * 32
    return result


def test_constant_current_draws_power_times_time():
    use = battery_use(flight())
    assert use.energy_drawn[-1] == pytest.approx(CURRENT * VOLTAGE * HOURS)
    assert use.charge_left == pytest.approx(0.5 - CURRENT * HOURS / CAPACITY)
    assert use.energy_left == pytest.approx(use.charge_left * CAPACITY * CELLS * 3.7)


@pytest.mark.parametrize(("effect", "cutoff"), [({}, 12.0), ({"cutoff_voltage": 3.3}, 13.2)])
def test_cutoff_is_read_from_scene(effect, cutoff):
    use = battery_use(flight(**effect))
    assert use.cutoff == pytest.approx(cutoff)
    assert f"{cutoff:.1f} V at the cut-off" in str(use)


def test_plot_has_every_quantity_in_order():
    labels = [panel.y_label for panel in battery.draw(flight()).panels]
    assert labels == ["charge [%]", "voltage [V]", "current [A]", "power [W]", "energy drawn [W h]"]


def test_unmodelled_battery_is_left_out():
    assert battery_use(flight(charge=False)) is None
    with pytest.raises(NotRecordedError, match="has no battery model"):
        battery.draw(flight(charge=False))


def test_key_number_has_charge_left():
    (left,) = [number for number in key_numbers(flight()) if number.label == "battery left"]
    assert (left.value, left.unit) == (pytest.approx(100.0 * (0.5 - CURRENT * HOURS / CAPACITY)), "%")


@pytest.mark.long
def test_current_without_battery_model_is_power_over_voltage():
    flight = simulate.fly(load("hover", ["run.duration=3"]))
    battery, truth = flight.topic("battery"), flight.topic("ground_truth")
    power = truth["motor_power"][np.searchsorted(truth.times, battery.times)].sum(axis=1)
    assert power.max() > 500.0
    assert -battery["current"] * battery["voltage"] == pytest.approx(power, rel=1e-5)

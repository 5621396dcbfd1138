"""`import lapwing`: passed controllers and estimators, loaded scenes, campaigns, and errors of one line."""

import sys
import traceback
from typing import NamedTuple

import numpy as np
import pytest

import lapwing
from lapwing.services.autopilot.custom.estimator_api import StateEstimate
from lapwing.services.common.controller_api import ThrustAndMoments

MODULE = """
from lapwing.services.common.controller_api import ThrustAndMoments

class Altitude:
    rate = 125.0

    def __init__(self, vehicle, extra=0.0):
        self.weight = vehicle.mass * vehicle.gravity + extra

    def step(self, time, estimate, setpoint):
        p, v, r, s = estimate.position_world, estimate.velocity_world, setpoint.position_world, setpoint.velocity_world
        w = estimate.omega_body
        thrust = self.weight + 60.0 * (r[2] - p[2]) + 40.0 * (s[2] - v[2])
        return ThrustAndMoments(thrust, (-3.0 * w[0], -3.0 * w[1], -3.0 * w[2]))
"""
SHORT = {"run.duration": 1.5}


@pytest.fixture
def altitude(tmp_path, monkeypatch):
    """Yield the controller class of a module on Python's path."""
    (tmp_path / "given_altitude.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)
    import given_altitude

    yield given_altitude.Altitude
    del sys.modules["given_altitude"]


def test_class_copy_and_name_of_controller_fly_alike(altitude):
    named = lapwing.fly("hover", {**SHORT, "autopilot.controller": "given_altitude:Altitude"})
    vehicle = named.config.services["autopilot"].parameters.vehicle
    flights = [
        lapwing.fly("hover", SHORT, controller="given_altitude:Altitude"),
        lapwing.fly("hover", SHORT, controller=altitude),
        lapwing.fly("hover", SHORT, controller=altitude(vehicle)),
        lapwing.fly(lapwing.load_scene("hover", SHORT), controller=type("Local", (altitude,), {})),
    ]
    assert {flight.digest for flight in flights} == {named.digest}
    assert [len(flight.config.modules) for flight in flights] == [1, 1, 0, 0]  # text that a log would store
    assert named.digest != lapwing.fly("hover", SHORT, controller=altitude, controller_options={"extra": 9.0}).digest


def test_edited_class_flies_with_its_passed_source(altitude, tmp_path):
    before = lapwing.fly("hover", SHORT, controller=altitude)
    (tmp_path / "given_altitude.py").write_text(MODULE.replace("60.0", "30.0"))
    assert lapwing.fly("hover", SHORT, controller=altitude).digest == before.digest


def test_estimator_class_is_accepted_like_controller():
    class Blind:
        rate = 250

        def __init__(self, vehicle, height=0.0):
            self.height = height + vehicle.resting_height

        def step(self, time, readings):
            return StateEstimate(position_world=(0.0, 0.0, self.height))

    flight = lapwing.fly("hover", {"run.duration": 0.5}, estimator=Blind, estimator_options={"height": 0.25})
    assert flight.estimate.position[:, 2] == pytest.approx(0.6)


class Faulty(NamedTuple):
    """A controller with a configured rate that returns a configured value or raises."""

    output: object
    rate: float = 250.0

    def step(self, time, estimate, setpoint):
        """Raise or return as configured."""
        if isinstance(self.output, BaseException):
            raise self.output
        return self.output


@pytest.mark.parametrize(
    ("controller", "text"),
    [
        (Faulty((1.0, 2.0)), "step returned tuple, expected MotorVoltages or ThrustAndMoments"),
        (Faulty(ThrustAndMoments(1.0, (0.0, 0.0))), "step returned moments_body = (0.0, 0.0), expected 3 numbers"),
        (Faulty(ThrustAndMoments(np.zeros(2), (0.0,) * 3)), "thrust = (array([0., 0.]),), expected 1 number"),
        (Faulty(ThrustAndMoments(float("nan"), (0.0,) * 3)), "thrust = (nan,), which is not finite"),
        (Faulty(RuntimeError("no\nway")), "memory:Faulty: RuntimeError: no (test_api.py, line "),
        (Faulty(SystemExit(3)), "memory:Faulty: SystemExit: 3 (test_api.py, line "),
        (Faulty(ThrustAndMoments(1.0, (0.0,) * 3), 100.0), "expected a rate that divides communication.rate = 250 Hz"),
        (Faulty(ThrustAndMoments(1.0, (0.0,) * 3), "fast"), "has rate = 'fast'; expected a number of steps a second"),
        (7, "memory:int has no step; expected the method `step`"),
        ("memory:Gone", "Gone was an object in the memory of the Python session"),
        ("nowhere", "expected \"module:Name\", got 'nowhere'"),
    ],
)
def test_invalid_controller_is_one_line_scene_error(controller, text):
    with pytest.raises(lapwing.SceneError) as caught:
        lapwing.fly("hover", controller=controller)
    line = str(caught.value)
    assert line.startswith("override autopilot.controller: ")
    assert text in line
    assert "\n" not in line


def test_controller_options_need_class_and_autopilot():
    with pytest.raises(lapwing.SceneError, match="controller_options: a Faulty object takes no options"):
        lapwing.fly("hover", controller=Faulty(None), controller_options={"gain": 1.0})
    with pytest.raises(lapwing.SceneError, match="the model gyrostat has no such table"):
        lapwing.fly("gyrostat_chaotic", controller=Faulty(None))


def test_later_overrides_of_loaded_scene_take_precedence():
    scene = lapwing.load_scene("hover", {"run.duration": 1.5, "run.seed": 3})
    again = lapwing.load_scene(scene, ["run.duration=0.5"])
    assert (again.lookup("run.duration"), again.lookup("run.seed")) == (0.5, 3)
    assert lapwing.load_scene(again) is again
    assert repr(again) == "<Scene hover, run.duration=1.5, run.seed=3, run.duration=0.5>"
    flight = lapwing.fly(scene, {"run.duration": 0.5}, seed=4)
    assert (flight.config.seed, flight.config.duration) == (4, 0.5)
    assert repr(flight).startswith("<Flight of hover: Completed at 0.50 s: ")


def test_campaign_varies_loaded_scene_by_seed_and_run():
    scene = lapwing.load_scene("hover", {"run.duration": 0.5})
    vary = {"vehicle.mass": lapwing.normal(10.4, 0.2)}
    flights = lapwing.campaign(scene, (5, 6, 7), vary, seed=4)
    masses = [flight.config.services["autopilot"].parameters.airframe.mass for flight in flights]
    assert len(set(masses)) == 3
    assert 9.4 < min(masses) < max(masses) < 11.4
    assert [flight.config.seed for flight in flights] == [5, 6, 7]
    fewer = lapwing.campaign(scene, (5, 6), vary, seed=4)
    assert [f.digest for f in fewer] == [f.digest for f in flights[:2]]


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (lambda: lapwing.campaign("hover", [1], {"vehicle.mass": 10.4}), "vehicle.mass: expected a distribution"),
        (lambda: lapwing.campaign("hover", [1], {"vehicle.mas": lapwing.normal(1.0, 0.0)}), "did you mean mass?"),
        (lambda: lapwing.campaign("hover", []), "seeds: expected at least one, got none"),
        (
            lambda: lapwing.campaign("hover", 5),
            "seeds: expected several whole numbers, for example range(1, 101), got 5",
        ),
        (lambda: lapwing.fly(None), "scene: expected a name, a path, or a loaded scene, got None"),
        (lambda: lapwing.fly("hover", seed=-1), "run.seed: expected a whole number at least 0"),
        (lambda: lapwing.fly("hoverr"), "unknown scene 'hoverr'; did you mean hover?"),
        (lambda: lapwing.load_scene("hover", "run.seed=1"), "a list: [\"KEY=VALUE\"], got 'run.seed=1'"),
        (lambda: lapwing.load_scene("hover", {3: 1}), "expected the keys of overrides as texts, got 3"),
        (lambda: lapwing.Simulator("gyrostat_chaotic"), "autopilot: the scene has no autopilot"),
    ],
)
def test_invalid_arguments_are_scene_errors_of_one_line(wrong, text):
    with pytest.raises(lapwing.SceneError) as caught:
        wrong()
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("function", [lapwing.fly, lapwing.load_scene, lapwing.campaign, lapwing.Simulator])
def test_traceback_of_scene_error_ends_at_call(function):
    with pytest.raises(lapwing.SceneError) as caught:
        function("hoverr")
    assert [entry.name for entry in caught.traceback] == ["test_traceback_of_scene_error_ends_at_call", "call"]
    assert traceback.format_exception_only(caught.value)[0].startswith("lapwing.SceneError: unknown scene 'hoverr'")


def test_campaign_names_its_argument():
    with pytest.raises(ValueError, match=r"^design halton: expected one of random"):
        lapwing.campaign("hover", [1], design="halton")


def test_constructor_without_arguments_is_error_of_controller():
    expected = (
        r"^override autopilot.controller: TypeError: Bare\(\) takes no arguments; expected a constructor with one"
    )
    with pytest.raises(lapwing.SceneError, match=expected):
        lapwing.fly("hover", controller=type("Bare", (), {"rate": 250.0, "step": Faulty.step}))


def test_flight_of_campaign_has_drawn_values():
    (flight,) = lapwing.campaign("hover", [1], {"vehicle.mass": lapwing.choice(10.2)}, {"run.duration": 0.1})
    assert flight.drawn == {"vehicle.mass": 10.2}
    assert flight.config.resolved["vehicle"]["mass"] == 10.2


@pytest.mark.parametrize("wrong", [lambda: lapwing.normal(1.0, -1.0), lapwing.choice, lambda: lapwing.uniform(2, 1)])
def test_invalid_distribution_is_rejected_at_construction(wrong):
    with pytest.raises(ValueError, match="expected"):
        wrong()


def test_plot_is_figure_and_file(tmp_path):
    flight = lapwing.fly("hover", {"run.duration": 0.5})
    figure = flight.plot(tmp_path / "flight.png")
    assert len(figure.axes) == 4
    assert (tmp_path / "flight.png").stat().st_size > 10_000
    for compare in (flight.report, flight.view):
        with pytest.raises(ValueError, match=r"compare_with: expected a flight, .*, got 'second.mcap'"):
            compare(compare_with="second.mcap")
    with pytest.raises(ValueError, match=r"none/flight.png: cannot be written: there is no folder"):
        flight.plot(tmp_path / "none" / "flight.png")

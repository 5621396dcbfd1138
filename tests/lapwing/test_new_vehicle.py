"""`lapwing new vehicle`: its file is valid and the vehicle can hover, or it is rejected in one line."""

import math
import os
import pty
import re
import select
import sys

import pytest
from typer.testing import CliRunner

from lapwing.airframe_writer import SPINS
from lapwing.cli.main import app
from lapwing.cli.new_vehicle import write_vehicle
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.performance import rotor_of, thrust_over_weight
from lapwing.services.scene_resolver import load
from lapwing.vehicle_measurements import FIGURES


@pytest.mark.parametrize(
    "figures", [{}, {"rotors": 6.0}, {"rotors": 8.0, "mass": 12.0}, {"mass": 0.25}, {"mass": 80.0}]
)
def test_guesses_make_vehicle_that_scene_accepts(tmp_path, figures):
    path, remarks = write_vehicle("mine", figures, tmp_path)
    frame = load_airframe(path)
    assert not remarks
    assert 1.5 < thrust_over_weight(frame) < 4.0
    assert "Guessed, not measured: arm, " in path.read_text()
    assert load("hover", {"vehicle.airframe": str(path)}).lookup("airframe.mass.total") == figures.get("mass", 2.0)


def test_rotors_reproduce_thrust_stand(tmp_path):
    stand = {"stand_density": 1.19, "stand_speed": 700.0, "stand_thrust": 5.6, "stand_torque": 0.11, "diameter": 0.254}
    rotor = rotor_of(load_airframe(write_vehicle("mine", stand, tmp_path)[0]))
    thrust, torque = rotor.constants(1.19)
    assert thrust * 700.0**2 == pytest.approx(5.6, rel=1e-4)
    assert torque * 700.0**2 == pytest.approx(0.11, rel=1e-4)


def test_missing_figure_is_prompted_with_its_measurement(tmp_path):
    requested = []

    def ask(figure, guess):
        requested.append(figure.name)
        assert len(figure.how) > 10
        return guess if figure.name != "arm" else None

    path, _ = write_vehicle("mine", {"mass": 3.0}, tmp_path, ask)
    assert requested == [figure.name for figure in FIGURES if figure.name != "mass"]
    assert "Guessed, not measured: arm." in path.read_text()


def in_a_terminal(folder, *answers, more=()):
    """Return output and exit code of `lapwing new vehicle mine` with these typed answers."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.chdir(folder)
        os.execv(sys.executable, [sys.executable, "-m", "lapwing", "new", "vehicle", "mine", *more])
    output, left, typed = b"", list(answers), b""
    while True:
        if not select.select([terminal], [], [], 1.0)[0]:
            if typed == b"\x03":  # Python misses Ctrl-C just before it waits for a line: repeat
                os.write(terminal, typed)
            continue
        try:
            output += os.read(terminal, 4096)
        except OSError:  # closed with the last process on it
            break
        if output.endswith((b"]: ", b"[y/N] ")):
            typed = left.pop(0).encode() if left else b"\x04"  # end the input after the last answer
            os.write(terminal, typed)
    return output.decode().replace("\r\n", "\n"), os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def test_invalid_terminal_input_is_prompted_again(tmp_path):
    answers = ("1,5 kg\n", "1500\n", "n\n", "-1\n", "1.5\n", "\n", "5\n", "4.5\n", "6\n", *["\n"] * 40)
    output, code = in_a_terminal(tmp_path, *answers)
    assert code == 0, output
    assert "mass: expected a number in kg alone, as 2, got '1,5 kg'" in output
    assert "mass = 1500 kg, where about 2 is usual: is that the unit? [y/N]" in output
    assert "mass: expected a number above 0 and below 10000, in kg, got -1" in output
    assert "rotors: expected 4, 6 or 8; edit the file for other numbers, got 5" in output
    assert "rotors: expected a whole number, got 4.5" in output
    text = (tmp_path / "vehicles/mine.toml").read_text()
    assert "total = 1.5 " in text
    assert "Guessed, not measured: arm, " in text  # answers by Enter
    assert "mass" not in text.splitlines()[1]


@pytest.mark.parametrize(
    ("end", "code", "last"), [("\x03", 130, "ended by SIGINT"), ("\x04", 2, "standard input has ended")]
)
def test_interrupted_interview_prints_its_answers(tmp_path, end, code, last):
    output, result = in_a_terminal(tmp_path, "1.5\n", "\n", "6\n", end)
    assert result == code
    assert "with these answers: lapwing new vehicle mine --set mass=1.5 --set rotors=6" in output
    assert last in output.splitlines()[-1]
    assert "Traceback" not in output
    assert not (tmp_path / "vehicles").exists()


def test_answers_that_do_not_fit_together_are_printed(tmp_path):
    output, code = in_a_terminal(tmp_path, "1.5\n", "2\n", *["\n"] * 40)
    assert code == 2
    assert "with these answers: lapwing new vehicle mine --set mass=1.5 --set payload=2" in output
    assert "mass.payload: expected less than total = 1.5 kg, got 2" in output.splitlines()[-1]


def test_figure_far_from_its_guess_is_warned_of(tmp_path):
    _, remarks = write_vehicle("mine", {"diameter": 10.0, "mass": 30.0}, tmp_path)
    assert remarks[0] == "diameter = 10 m, where about 0.98 is usual: is that the unit?"
    assert "diameter" in remarks[0]


@pytest.mark.parametrize(
    ("figures", "message"),
    [
        ({"mass": -1.0}, "mass: expected a number above 0 and below 10000, in kg, got -1"),
        ({"rotors": 5.0}, "rotors: expected 4, 6 or 8"),
        ({"cells": 4.5}, "cells: expected a whole number, got 4.5"),
        ({"mass": math.nan}, "mass: expected a number"),
        ({"payload": 3.0}, "mass.payload: expected less than total"),
        ({"inertia_z": 9.0}, "triangle inequality"),
        ({"speed_constant": 100.0}, r"mine cannot hover: its thrust is 0\.\d\d times its weight; expected more than 1"),
        (
            {"resistance": 60.0},
            r"0\.6 A without load, with 36 V .* A and 14\.8 V; resistance = 60 ohm",
        ),
        ({"stand_thrust": 50.0, "stand_torque": 1.0}, r"50 N at .* rad/s is more than the .* N that a propeller"),
        ({"stand_torque": 1e-4}, r"0.0001 N m at .* rad/s is less than the .* N m that this thrust needs"),
    ],
)
def test_invalid_figure_is_rejected_without_output_file(tmp_path, figures, message):
    with pytest.raises(ValueError, match=message) as error:
        write_vehicle("mine", figures, tmp_path)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "vehicles").exists()


def test_weak_vehicle_is_warned_of_and_names_are_kept(tmp_path):
    _, (remark,) = write_vehicle("mine", {"speed_constant": 470.0}, tmp_path)
    assert re.fullmatch(r"its thrust is 1\.\d\d times its weight; control authority is small below 1.4", remark)
    for name in ("mine", "delivery_drone", "My Quad"):
        with pytest.raises(ValueError, match=f"NAME {name}"):
            write_vehicle(name, {}, tmp_path)


def test_command_writes_vehicle_and_rejects_unknown_figure(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["new", "vehicle", "mine", "--set", "mass=1.2"])
    assert done.exit_code == 0, done.output
    assert "vehicles/mine.toml" in done.output
    assert "lapwing tune excitation" in done.output
    wrong = CliRunner().invoke(app, ["new", "vehicle", "other", "--set", "mas=1.2"])
    assert wrong.exit_code == 2
    assert "unknown figure 'mas'; did you mean mass?" in wrong.output


def test_usual_motor_resistance_is_accepted_without_question():
    (figure,) = (figure for figure in FIGURES if figure.name == "resistance")
    assert figure.plausibility_question(0.06, 1.1) == ""
    assert "is that the unit?" in figure.plausibility_question(60.0, 0.06)


def test_neighbouring_rotors_turn_in_opposite_directions():
    for spins in SPINS.values():
        assert all(a != b for a, b in zip(spins, (*spins[1:], spins[0]), strict=True))

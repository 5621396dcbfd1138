"""`lapwing new vehicle`: its file is valid and the vehicle can hover, or it is rejected in one line."""

import math
import os
import pty
import random
import re
import select
import sys

import pytest
from typer.testing import CliRunner

from lapwing.cli.airframe_writer import SPINS
from lapwing.cli.main import app
from lapwing.cli.new_vehicle import write_vehicle
from lapwing.cli.vehicle_measurements import BY_NAME, FIGURES, parse_settings, parts
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.vehicles.airframe import load_airframe
from lapwing.dynamics.vehicles.performance import rotor_of, thrust_over_weight
from lapwing.services.scene_resolver import load


@pytest.mark.parametrize(
    "figures", [{}, {"rotors": 6.0}, {"rotors": 8.0, "mass": 12.0}, {"mass": 0.25}, {"mass": 80.0}]
)
def test_guesses_make_vehicle_that_scene_accepts(tmp_path, figures):
    path, _, remarks = write_vehicle("mine", figures, tmp_path)
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

    def ask(figure, guess, check):
        requested.append(figure.name)
        assert len(figure.how) > 10
        return guess if figure.name != "arm" else None

    path, _, _ = write_vehicle("mine", {"mass": 3.0}, tmp_path, ask)
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
    assert "mass: expected a number in kg, or with a unit of g, lb, oz, got '1,5 kg'" in output
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


def test_answer_that_contradicts_earlier_ones_is_prompted_again(tmp_path):
    output, code = in_a_terminal(tmp_path, "1.5\n", "2\n", "0.2\n", *["\n"] * 40)
    assert code == 0, output
    assert "payload: expected less than total = 1.5 kg, got 2\npayload, kg [0]: " in output
    assert "payload = 0.2 " in (tmp_path / "vehicles/mine.toml").read_text()


def test_new_vehicle_rejects_contradicting_options_before_it_asks(tmp_path):
    output, code = in_a_terminal(tmp_path, more=("--set", "mass=1.5", "--set", "payload=2"))
    assert (code, output) == (2, "lapwing: --set payload: expected less than total = 1.5 kg, got 2\n")


def test_figure_far_from_its_guess_is_warned_of(tmp_path):
    _, _, remarks = write_vehicle("mine", {"diameter": 10.0, "mass": 30.0}, tmp_path)
    assert remarks[0] == "diameter = 10 m, where about 0.99 is usual: is that the unit?"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("diameter=15", "diameter=15: 15 m, where about 0.26 is usual; expected 15in, or 15m if that is right"),
        ("mass=5 arm=40", "arm=40: 40 m, where about 0.36 is usual; expected 40cm, or 40m if that is right"),
        ("mass=750", "mass=750: 750 kg, where about 2 is usual; expected 750g, or 750kg if that is right"),
        ("mass=750g esc_current=30mA", "esc_current: 0.03 A needs cells = 112, where about 2.4 is usual; expected"),
        ("mass=750g cells=4S esc_current=30mA", "esc_current: 0.03 A needs "),
        ("stand_speed=6000", "stand_speed=6000: 6000 rad/s, where about 610 is usual; expected 6000rpm, or 6000rad/s"),
    ],
)
def test_number_whose_unit_was_probably_forgotten_is_rejected(tmp_path, monkeypatch, options, message):
    monkeypatch.chdir(tmp_path)
    given = [option for each in options.split() for option in ("--set", each)]
    done = CliRunner().invoke(app, ["new", "vehicle", "mine", *given])
    assert done.exit_code == 2
    assert f"--set {message}" in done.output
    assert not list(tmp_path.iterdir())
    done = CliRunner().invoke(app, ["new", "vehicle", "mine", "--set", "diameter=15m"])
    assert (done.exit_code, "diameter = 15 m, where about 0.26 is usual: is that the unit?" in done.output) == (0, True)


@pytest.mark.parametrize(
    ("figures", "message"),
    [
        ({"mass": -1.0}, "mass: expected a number above 0 and below 10000, in kg, got -1"),
        ({"rotors": 5.0}, "rotors: expected 4, 6 or 8"),
        ({"cells": 4.5}, "cells: expected a whole number, got 4.5"),
        ({"mass": math.nan}, "mass: expected a number"),
        ({"mass": 2.0, "payload": 3.0}, "payload: expected less than total"),
        ({"mass": 2.0, "arm": 0.2, "inertia_x": 0.02, "inertia_y": 0.02, "inertia_z": 9.0}, "inertia_x, inertia"),
        (
            {"mass": 2.0, "diameter": 0.25, "cells": 4.0, "speed_constant": 100.0},
            r"speed_constant: the thrust is 0\.\d\d times the weight, limited by the 14.8 V of the battery; "
            "expected more lift by speed_constant, cells, diameter, or less mass",
        ),
        (
            {"mass": 2.0, "diameter": 0.25, "cells": 4.0, "speed_constant": 800.0, "esc_current": 2.0},
            r"esc_current: the thrust is 0\.\d\d times the weight, limited by the 2 A of the controller",
        ),
        (
            {"resistance": 60.0, "no_load_current": 0.6, "cells": 4.0},
            r"resistance: 60 ohm take 36 V at no_load_current = 0.6 A, of 14.8 V; expected less than 24.7 ohm",
        ),
        (
            {"stand_speed": 600.0, "stand_thrust": 50.0, "diameter": 0.25, "pitch": 0.1},
            r"stand_thrust: 50 N at 600 rad/s is more than .* expected at most 7.\d* N, a higher speed",
        ),
        (
            {"stand_torque": 1e-4, "stand_thrust": 5.0, "diameter": 0.25, "pitch": 0.11},
            r"stand_torque: 0.0001 N m at .* rad/s is less than a thrust of 5 N needs; expected at least 0.0",
        ),
    ],
)
def test_invalid_figure_is_rejected_without_output_file(tmp_path, figures, message):
    with pytest.raises(ValueError, match=message) as error:
        write_vehicle("mine", figures, tmp_path)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "vehicles").exists()


def test_weak_vehicle_is_warned_of_and_names_are_kept(tmp_path):
    weak = {"mass": 2.0, "diameter": 0.25, "pitch": 0.11, "cells": 4.0, "speed_constant": 370.0}
    _, lift, (remark,) = write_vehicle("mine", weak, tmp_path)
    assert lift.endswith("limited by the 14.8 V of the battery (speed_constant, cells, diameter)")
    assert re.fullmatch(r"its thrust is 1\.\d\d times its weight; control authority is small below 1.4", remark)
    for name in ("mine", "delivery_drone", "My Quad"):
        with pytest.raises(ValueError, match=f"NAME {name}"):
            write_vehicle(name, {}, tmp_path)


def test_command_writes_vehicle_and_rejects_unknown_figure(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["new", "vehicle", "mine", "--set", "mass=1.2"])
    assert done.exit_code == 0, done.output
    assert "thrust over weight 2." in done.output
    assert "vehicles/mine.toml" in done.output
    assert "lapwing tune excitation" in done.output
    wrong = CliRunner().invoke(app, ["new", "vehicle", "other", "--set", "mas=1.2"])
    assert wrong.exit_code == 2
    assert "unknown figure 'mas'; did you mean mass?" in wrong.output


WIDE = [  # from a data sheet each: what a user knows about vehicles of 30 g to 25 kg
    "mass=30g diameter=45mm cells=1S capacity=250mAh speed_constant=14000KV",
    "mass=75g arm=38mm propeller=1.6x1.6x4 cells=2",
    "mass=249g propeller=3x3x3 cells=4 speed_constant=3800 capacity=650mAh c_rating=95C",
    "mass=750g arm=125mm propeller=5.1x4.3x3 motor=kde2306xf_2050 cells=4S capacity=1500mAh c_rating=120C",
    "mass=1.5kg arm=0.25 propeller=apc_sf_10x4.7 motor=sunnysky_x2216_880 cells=3S",
    "rotors=6 mass=5 arm=0.4 diameter=0.381 cells=6 speed_constant=380",
    "rotors=6 mass=5 arm=0.4 diameter=15in pitch=5in cells=6 speed_constant=380 blades=2",
    "rotors=6 mass=5 arm=0.4 diameter=0.381 pitch=0.1 blades=2 motor=kde4014xf_380 cells=6S",
    "rotors=8 mass=25lb arm=0.6 propeller=17x5.8 cells=12 speed_constant=170",
    "rotors=8 mass=25 propeller=28x9.2 cells=12S capacity=22Ah c_rating=25",
    "rotors=6 mass=25 arm=0.8 motor=kde10218xf_105 cells=12",
    "rotors=4 speed_constant=900KV esc_current=12A",
    "diameter=13in capacity=8400mAh cell=molicel_p42a",
    "stand_thrust=800gf stand_speed=9000rpm",
    "mass=2 inertia_z=400kgcm2",
]


@pytest.mark.parametrize("figures", WIDE)
def test_guesses_fit_any_figures_of_a_data_sheet(tmp_path, monkeypatch, figures):
    monkeypatch.chdir(tmp_path)
    options = [option for figure in figures.split() for option in ("--set", figure)]
    done = CliRunner().invoke(app, ["new", "vehicle", "mine", *options])
    assert done.exit_code == 0, done.output
    assert "warning" not in done.output
    frame = load_airframe("vehicles/mine.toml")
    assert 1.5 < thrust_over_weight(frame) < 8.0
    assert f"thrust over weight {thrust_over_weight(frame):.2f}, limited by the " in done.output
    x, y = frame.rotors.position[0][:2]
    neighbours = 2.0 * math.hypot(x, y) * math.sin(math.pi / len(frame.rotors.position))
    assert frame.propeller.diameter < neighbours


@pytest.mark.parametrize("seed", range(60))
def test_guesses_fit_random_subsets_of_a_vehicle(tmp_path, seed):
    draw = random.Random(seed)
    mass, rotors = 10.0 ** draw.uniform(math.log10(0.03), math.log10(25.0)), draw.choice([4, 6, 8])
    arm = 0.16 * math.sqrt(mass) * draw.uniform(0.7, 1.4)
    diameter = 2.0 * arm * math.sin(math.pi / rotors) * draw.uniform(0.7, 0.95)
    whole = {
        "mass": mass,
        "rotors": float(rotors),
        "arm": arm,
        "diameter": diameter,
        "pitch": diameter * draw.uniform(0.25, 1.1),
        "blades": float(draw.choice([2, 3])),
        "inertia_y": 0.2 * mass * arm**2 * draw.uniform(0.5, 2.0),
        "inertia_z": 0.4 * mass * arm**2 * draw.uniform(0.5, 2.0),
        "cells": float(max(1, round(2.8 * math.sqrt(mass) * draw.uniform(0.7, 1.5)))),
        "c_rating": draw.uniform(15.0, 150.0),
        "payload": draw.uniform(0.0, 0.4) * mass,
    }
    known = {name: whole[name] for name in draw.sample(sorted(whole), draw.randint(1, 8))}
    known.pop("payload" if "mass" not in known else "", None)
    path, _, _ = write_vehicle("mine", known, tmp_path)
    assert thrust_over_weight(load_airframe(path)) > 1.4


@pytest.mark.parametrize(
    ("setting", "name", "value"),
    [
        ("diameter=7in", "diameter", 0.1778),
        ('diameter=7"', "diameter", 0.1778),
        ("speed_constant=1300KV", "speed_constant", 1300.0),
        ("cells=6S", "cells", 6.0),
        ("mass=750g", "mass", 0.75),
        ("mass=.75", "mass", 0.75),
        ("c_rating=120C", "c_rating", 120.0),
        ("capacity=2.2 Ah", "capacity", 2200.0),
        ("resistance=60mΩ", "resistance", 0.06),
        ("stand_speed=6000 rpm", "stand_speed", 628.3185),
        ("stand_thrust=1kgf", "stand_thrust", 9.80665),
        ("inertia_x=210 kg cm^2", "inertia_x", 0.021),
        ("drag_area=250cm²", "drag_area", 0.025),
        ("propeller=10x4.5", "pitch", 0.1143),
        ("propeller=5.1x4.3x3", "blades", 3.0),
        ("motor=kde4014xf_380", "resistance", 0.075),
        ("cell=molicel_p42a", "capacity", 4200.0),
    ],
)
def test_figures_and_parts_are_read_with_their_units(setting, name, value):
    assert parse_settings([setting])[name] == pytest.approx(value)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("mass=750mg", "--set mass=750mg: expected a number in kg, or with a unit of g, lb, oz, got '750mg'"),
        ("mass=", "--set mass=: expected a number in kg"),
        ("motor=kde4014", "--set motor=kde4014: unknown motor 'kde4014'; did you mean kde4014xf_380? expected one of"),
        ("propeller=10in", "--set propeller=10in: unknown propeller '10in'"),
        ("cells=-1", "--set cells=-1: expected a number above 0 and below 1000, in count, got -1"),
    ],
)
def test_invalid_setting_names_its_option(setting, message):
    with pytest.raises(ConfigError) as error:
        parse_settings([setting])
    assert str(error.value).startswith(message)


def test_parts_are_complete_and_have_sources():
    for kind, members in parts().items():
        for name, part in members.items():
            assert part.pop("source"), (kind, name)
            for figure, value in part.items():
                BY_NAME[figure].check(float(value))


def test_propellers_of_the_table_are_reproduced(tmp_path):
    for number, (name, part) in enumerate(parts()["propeller"].items()):
        path, _, _ = write_vehicle(f"v{number}", parse_settings([f"propeller={name}"]), tmp_path)
        thrust, torque = rotor_of(load_airframe(path)).constants(1.225)
        assert thrust * part["stand_speed"] ** 2 == pytest.approx(part["stand_thrust"], rel=1e-4), name
        assert torque * part["stand_speed"] ** 2 == pytest.approx(part["stand_torque"], rel=1e-4), name


def test_usual_motor_resistance_is_accepted_without_question():
    assert BY_NAME["resistance"].plausibility_question(0.06, 1.1) == ""
    assert "is that the unit?" in BY_NAME["resistance"].plausibility_question(60.0, 0.06)


def test_neighbouring_rotors_turn_in_opposite_directions():
    for spins in SPINS.values():
        assert all(a != b for a, b in zip(spins, (*spins[1:], spins[0]), strict=True))

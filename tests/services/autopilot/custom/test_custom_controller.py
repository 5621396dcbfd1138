"""User-defined controllers: in Python and compiled, and their error messages."""

import re
from pathlib import Path

import numpy as np
import pytest

from lapwing.cosim.log import LogReader
from lapwing.dynamics.config_error import ConfigError
from lapwing.runs.multi_process_run import fly_processes
from lapwing.runs.observer import Silent
from lapwing.runs.resimulate import resimulate
from lapwing.runs.single_process_run import fly_single
from lapwing.services.process_main import ProcessSpec
from lapwing.services.scene_resolver import from_resolved, load, resolve
from lapwing.studies.simulate import fly

pytestmark = pytest.mark.long

HOVER = Path("lapwing/scenes/hover.toml")

LAW = """
def law(weight, estimate, setpoint):
    p, v, r, s = estimate.position_world, estimate.velocity_world, setpoint.position_world, setpoint.velocity_world
    thrust = weight + 60.0 * (r[2] - p[2]) + 40.0 * (s[2] - v[2])
    w = estimate.omega_body
    return thrust, (-3.0 * w[0], -3.0 * w[1], -3.0 * w[2])
"""
IN_PYTHON = f"""
from lapwing.services.common.controller_api import ThrustAndMoments
{LAW}
class Altitude:
    rate = 125.0

    def __init__(self, vehicle, extra=0.0):
        self.weight = vehicle.mass * vehicle.gravity + extra

    def step(self, time, estimate, setpoint):
        return ThrustAndMoments(*law(self.weight, estimate, setpoint))
"""
COMPILED = f"""
from typing import NamedTuple
from lapwing.kernels import kernel
from lapwing.services.common.controller_api import ThrustAndMoments

class Parameters(NamedTuple):
    rate: float
    weight: float

class State(NamedTuple):
    steps: float

def altitude(vehicle, extra=0.0):
    return Parameters(125.0, vehicle.mass * vehicle.gravity + extra), State(0.0)

@kernel{LAW}
@kernel
def step(p, s, time, estimate, setpoint):
    thrust, moments = law(p.weight, estimate, setpoint)
    return State(s.steps + 1.0), ThrustAndMoments(thrust, moments)
"""
VOLTS = """
from lapwing.services.common.controller_api import MotorVoltages

class Full:
    rate = 250
    def __init__(self, vehicle):
        self.volts = vehicle.voltage_max
    def step(self, time, estimate, setpoint):
        return MotorVoltages((self.volts + 5.0, self.volts, self.volts, -1.0))
"""


@pytest.fixture
def scene(tmp_path):
    """Return a function that loads the hover scene with a controller module in the same folder."""

    def make(module, text, name, *overrides):
        (tmp_path / f"{module}.py").write_text(text)
        path = tmp_path / "hover.toml"
        path.write_text(HOVER.read_text())
        return load(path, [f'autopilot.controller="{module}:{name}"', *overrides])

    return make


def test_python_controller_flies_and_holds_its_command(scene):
    flight = fly(scene("own_python", IN_PYTHON, "Altitude"))
    assert flight.landed
    assert flight.rmse["z"] < 0.1
    thrust = flight.actuators["thrust"]
    flying = np.flatnonzero(thrust[:, 0] > 0.0)
    first = flying[0] + flying[0] % 2
    pairs = thrust[first : first + 1000].reshape(-1, 2, 4)
    assert (pairs[:, 0] == pairs[:, 1]).all()
    assert (np.diff(pairs[:, 0], axis=0) != 0.0).any()


def test_compiled_controller_equals_python_controller(scene):
    in_python = fly(scene("own_python", IN_PYTHON, "Altitude"))
    compiled = fly(scene("own_compiled", COMPILED, "altitude"))
    assert compiled.digest == in_python.digest


def test_options_reach_constructor(scene):
    more = fly(scene("own_python", IN_PYTHON, "Altitude", "autopilot.controller_options.extra=12.0"))
    assert more.rmse["z"] > 0.1  # 12 N too much over 60 N/m


def test_voltages_are_clipped_to_range(scene):
    flight = fly(scene("own_volts", VOLTS, "Full", "run.duration=0.5"))
    volts = flight.actuators["motor_voltage"]
    assert volts.max(axis=0) == pytest.approx([44.4, 44.4, 44.4, 0.0])


def test_configuration_has_controller_text(scene, tmp_path):
    custom = scene("own_python", IN_PYTHON, "Altitude", "run.duration=1.5")
    before = fly(custom).digest
    (tmp_path / "own_python.py").unlink()
    assert fly(from_resolved(custom.resolved, "hover")).digest == before
    assert resolve(custom).modules["own_python"] == IN_PYTHON
    assert custom.sources["modules.own_python.py"].decode() == IN_PYTHON


def test_log_resimulates_without_file_with_allowed_code(scene, tmp_path):
    custom, log = scene("own_python", IN_PYTHON, "Altitude", "run.duration=1.5"), tmp_path / "own.mcap"
    fly_single(resolve(custom), log)
    (tmp_path / "own_python.py").unlink()
    with pytest.raises(ValueError, match=r"contains code of its author \(modules.own_python.py\)"):
        resimulate(log)
    before, after = resimulate(log, allow_code=True)
    assert before == after


def test_autopilot_process_runs_controller_text_of_configuration(scene, tmp_path):
    custom, log = scene("own_python", IN_PYTHON, "Altitude", "run.duration=1.5"), tmp_path / "own.mcap"
    values = ProcessSpec("mission", resolve(custom), {}, "test-own-controller", log=str(log))
    (tmp_path / "own_python.py").unlink()
    fly_processes(values, Silent())
    with LogReader(log) as read:
        assert read.digest() == fly(custom).digest


def test_edited_module_is_reloaded(scene):
    fly(scene("own_edited", IN_PYTHON, "Altitude", "run.duration=1.5"))
    edited = fly(scene("own_edited", IN_PYTHON.replace("60.0", "30.0"), "Altitude", "run.duration=1.5"))
    original = fly(scene("own_python", IN_PYTHON, "Altitude", "run.duration=1.5"))
    assert edited.digest != original.digest
    assert fly(scene("own_edited", COMPILED, "altitude", "run.duration=1.5")).digest == original.digest
    text = COMPILED.replace("60.0", "30.0")
    assert fly(scene("own_edited", text, "altitude", "run.duration=1.5")).digest == edited.digest


def test_error_in_flight_names_controller_line_and_time(scene):
    text = IN_PYTHON.replace("        return T", "        if time > 1.0:\n            1 / 0\n        return T")
    flight = fly(scene("own_python", text, "Altitude"))
    output = r"controller own_python:Altitude: ZeroDivisionError: division by zero \(own_python.py, line \d+\)"
    assert re.fullmatch(f"{output} at t = 1.008 s", flight.failure)


def test_non_finite_command_is_rejected(scene):
    text = IN_PYTHON.replace(
        "        return T", "        if time > 1.0:\n            self.weight = float('nan')\n        return T"
    )
    assert (
        "own_python:Altitude: ValueError: step returned thrust = (nan,), which is not finite at t = 1.008 s"
        in fly(scene("own_python", text, "Altitude")).failure
    )


@pytest.mark.parametrize(
    ("module", "text", "name", "overrides", "message"),
    [
        ("own", IN_PYTHON, "Altitud", (), "unknown name in own 'Altitud'; did you mean Altitude?"),
        ("own", IN_PYTHON.replace("125.0", "100.0"), "Altitude", (), "expected a rate that divides communication.rate"),
        ("own", IN_PYTHON.replace("rate = 125.0", ""), "Altitude", (), "Altitude has rate = None"),
        ("own", "x = 1 +", "Altitude", (), "own.py, line 1: invalid syntax"),
        ("own", "import nowhere", "Altitude", (), "own: ModuleNotFoundError: No module named 'nowhere'"),
        ("own", IN_PYTHON.replace("step(", "fly("), "Altitude", (), "own:Altitude has no step"),
        ("own", IN_PYTHON.replace("return Thr", "return print or Thr"), "Altitude", (), "returned builtin"),
        ("own", COMPILED.replace("s.steps + 1.0", "1"), "altitude", (), "write every number as a float"),
        (
            "own",
            IN_PYTHON,
            "Altitude",
            ("autopilot.controller_options.stiffness=1.0",),
            "_options: TypeError: Altitude.__init__() got an unexpected keyword argument 'stiffness'",
        ),
    ],
)  # fmt: skip
def test_error_is_one_line_with_key(scene, module, text, name, overrides, message):
    with pytest.raises(ConfigError) as caught:
        resolve(scene(module, text, name, *overrides))
    line = str(caught.value)
    assert line.startswith("override autopilot.controller")
    assert message in line
    assert "\n" not in line


def test_missing_module_error_names_scene_line(tmp_path):
    path = tmp_path / "hover.toml"
    path.write_text(HOVER.read_text().replace('gains = "tuned"', 'controller = "nobody_has_this:C"'))
    with pytest.raises(
        ConfigError, match=r"hover.toml:\d+: autopilot.controller: no module nobody_has_this; expected .*"
    ):
        load(path)
    with pytest.raises(ConfigError, match='"module:Name"'):
        load(HOVER, ["autopilot.controller=my_module"])
    with pytest.raises(ConfigError, match="controller_options"):
        load(HOVER, ["autopilot.controller_options.a=1.0"])

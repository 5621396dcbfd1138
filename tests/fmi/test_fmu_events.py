"""Exported FMUs: early return at ground contact, log messages, and a million random inputs."""

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest
from recorded_ports import scene_config

pytest.importorskip("fmpy")
from driven_fmu import Slave

from lapwing.fmi.export.fmu import export_fmu
from tests.combinations import rest_nightly

pytestmark = pytest.mark.long
HEIGHT, START = "truth.position_world[2]", "state.plant.vehicle.motion.position_world[2]"
G, AT_REST, TICK = 9.80665, 0.35, 0.004


@pytest.fixture(scope="module", params=rest_nightly(3, 2))
def plant(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "plant.fmu"
    export_fmu(scene_config("hover", **{"run.duration": 2.0}), "plant", path, request.param)
    return path


def begun(path: Path, height: float, **options: bool) -> Slave:
    """Return an instance after its initialisation, in step mode."""
    a = Slave(path, **options)
    a.begin(**{START: height})
    if options.get("eventModeUsed"):
        a.fmu.enterStepMode()
    return a


@pytest.mark.parametrize("plant", [3], indirect=True)  # FMI 2.0 has no early return
def test_step_ends_early_at_touch_down(plant: Path) -> None:
    """A fall of 1 m takes sqrt(2 / g); the step ends at the following tick."""
    a = begun(plant, AT_REST + 1.0, eventModeUsed=True, earlyReturnAllowed=True)
    event, terminate, early, reached = a.fmu.doStep(0.0, 1.0)
    assert (event, terminate, early) == (True, False, True)
    fall = math.sqrt(2.0 / G)
    assert fall - 2 * TICK <= reached <= fall + 2 * TICK
    assert a.get(HEIGHT) == pytest.approx(AT_REST, abs=0.05)
    a.fmu.enterEventMode()
    a.fmu.updateDiscreteStates()
    a.fmu.enterStepMode()
    event, _, early, after = a.fmu.doStep(reached, 1.0 - reached)
    assert reached < after <= 1.0
    assert early == (after < 1.0)
    a.close()


def test_step_does_not_end_early_without_permission(plant: Path) -> None:
    a = begun(plant, AT_REST + 1.0)
    a.step(1.0)
    b = begun(plant, AT_REST + 1.0)
    for _ in range(250):
        b.step(TICK)
    assert a.get(HEIGHT) == b.get(HEIGHT)
    if a.is_3:
        c = begun(plant, AT_REST + 1.0, eventModeUsed=True, earlyReturnAllowed=False)
        event, _, early, reached = c.fmu.doStep(0.0, 1.0)
        assert (event, early, reached) == (True, False, 1.0)
        assert c.get(HEIGHT) == a.get(HEIGHT)


def test_errors_are_logged(plant: Path) -> None:
    a = begun(plant, AT_REST)
    with pytest.raises(Exception, match=r"."):
        a.fmu.doStep(currentCommunicationPoint=1.0, communicationStepSize=TICK)
    with pytest.raises(Exception, match=r"."):
        a.set(START, 2.0)
    assert len(a.messages) == 2
    assert all(status == 3 and text for status, text in a.messages)
    a.close()


def test_million_random_inputs_do_not_crash(plant: Path) -> None:
    a = begun(plant, 50.0)
    kind = "Float64" if a.is_3 else "Real"
    inputs = [v for v in a.model.modelVariables if v.causality == "input" and v.type == kind]
    n, rng, fresh, failures = len(inputs), np.random.default_rng(5), a.saved(), 0
    references = (ctypes.c_uint32 * n)(*(v.valueReference for v in inputs))
    values = (ctypes.c_double * n)()
    array = np.frombuffer(values)
    put = getattr(a.fmu.dll, f"fmi{3 if a.is_3 else 2}Set{kind}")
    component = a.fmu.component
    address = ctypes.c_void_p(component) if isinstance(component, int) else component
    arguments = (address, references, ctypes.c_size_t(n), values)
    arguments = (*arguments, ctypes.c_size_t(n)) if a.is_3 else arguments
    for _ in range(-(-1_000_000 // n)):
        array[:] = rng.uniform(-100.0, 100.0, n)
        array[rng.integers(n)] = rng.choice([math.nan, math.inf, -math.inf, 1e308, 5e-324])
        assert put(*arguments) == 0
        try:
            a.step(TICK)
        except Exception:
            failures += 1
            a.load(fresh)
            a.time = 0.0
    assert failures > 0
    a.load(fresh)
    a.time = 0.0
    array[:] = 0.0
    put(*arguments)
    a.step(TICK)
    assert a.get(HEIGHT) == pytest.approx(50.0, abs=1e-3)
    a.close()


def test_initialisation_mode_has_outputs_of_first_tick(plant: Path) -> None:
    """Importers read them there to set the inputs of other FMUs."""
    a, b = Slave(plant, "a"), Slave(plant, "b")
    a.prepare()
    assert a.get(HEIGHT) == pytest.approx(AT_REST, abs=0.01)
    a.set(START, AT_REST + 2.0)
    expected = a.get(HEIGHT)
    assert expected == pytest.approx(AT_REST + 2.0, abs=0.01)
    a.fmu.exitInitializationMode()
    b.begin(**{START: AT_REST + 2.0})
    assert a.get(HEIGHT) == b.get(HEIGHT) == expected
    a.step(10 * TICK)
    b.step(10 * TICK)
    assert a.get(HEIGHT) == b.get(HEIGHT)
    a.close()
    b.close()


def test_event_that_recorded_run_did_not_have_is_logged_once(tmp_path: Path) -> None:
    path = tmp_path / "pilot.fmu"
    export_fmu(scene_config("hover", **{"effects.battery": "{}"}), "autopilot", path)
    a = Slave(path, loggingOn=True)
    a.begin()
    a.set("battery.charge", 0.01)
    for _ in range(100):
        a.step(TICK)
    (message,) = a.messages
    assert "the recorded run of the scene did not have" in message[1]
    a.close()

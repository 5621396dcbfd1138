"""Exported plants whose propellers fail in flight (`[multibody.event]`): the failures have the bits of the run."""

from pathlib import Path

import numpy as np
import pytest
from recorded_ports import RecordedPorts, scene_config
from test_library import built

pytest.importorskip("fmpy")
from driven_fmu import Slave, assert_recorded_outputs
from fmpy import read_model_description, simulate_fmu
from fmpy.validation import validate_fmu

from lapwing.cosim.config.run_config import RunConfig
from lapwing.fmi.export.exported_part import export_part
from lapwing.fmi.export.fmu import export_fmu
from tests.combinations import NIGHTLY
from tests.commands import run_command

pytestmark = pytest.mark.long
LOCKED, FREE = '{time=2.601, propeller=2, failure="locked"}', '{time=2.602, propeller=1, failure="free"}'
TORN_OFF = '{time=2.605, propeller=4, failure="torn_off"}'  # in the tick after that of the others
FAILURES = f"[{LOCKED}, {FREE}, {TORN_OFF}]"
ONE_FAILURE = {"multibody.event": f"[{LOCKED}]", "run.duration": 2.8}  # each failure adds a kernel
SCENE = {"vehicle.model": "multibody", "run.duration": 3.6, "success.require": "[]"}  # it falls from 1 m
TICK, FIRST, SECOND = 0.004, 2.604, 2.608  # [s]; ends of the ticks in which propellers fail
SPEED = "truth.rotor_speed"


def config_of(**overrides: object) -> RunConfig:
    return scene_config("delivery_mission", **{**SCENE, "multibody.event": FAILURES, **overrides})


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """FMI 3.0, from the command."""
    path = tmp_path_factory.mktemp("fmu") / "vehicle.fmu"
    settings = [f"--set={key}={value}" for key, value in {**SCENE, "multibody.event": FAILURES}.items()]
    run_command("export-fmu", "delivery_mission", "--part", "vehicle", *settings, "--out", path, code=0)
    assert validate_fmu(str(path)) == []
    return path


def begun(path: Path, **options: bool) -> Slave:
    a = Slave(path, **options)
    a.begin()
    if options:
        a.fmu.enterStepMode()
    return a


def height_and_speeds(a: Slave) -> list[float]:
    return [a.get(name) for name in ("truth.position_world[2]", *(f"{SPEED}[{k}]" for k in range(4)))]


def stepped(a: Slave, ticks: int) -> list[list[float]]:
    result = []
    for _ in range(ticks):
        a.step(TICK)
        result.append(height_and_speeds(a))
    return result


def assert_intact_before_failure(recorded: RecordedPorts) -> None:
    intact = RecordedPorts(config_of(**{"multibody.event": "[]"}))
    equal = [np.array_equal(recorded.latest("truth", k), intact.latest("truth", k)) for k in range(recorded.ticks)]
    assert equal == [k * TICK < FIRST - TICK / 2 for k in range(recorded.ticks)]


@pytest.mark.nightly
def test_vehicle_has_recorded_outputs(vehicle: Path) -> None:
    recorded = RecordedPorts(config_of())
    assert_recorded_outputs(vehicle, export_part(recorded.config, "vehicle"), recorded)
    assert_intact_before_failure(recorded)


@NIGHTLY
def test_plant_in_euler_angles_has_recorded_outputs(tmp_path: Path) -> None:
    """The step in Euler angles creates arrays, in memory of the runtime."""
    recorded = RecordedPorts(config_of(**ONE_FAILURE, **{"multibody.coordinates": "euler"}))
    exported = export_fmu(recorded.config, "plant", tmp_path / "part.fmu")
    assert validate_fmu(str(tmp_path / "part.fmu")) == []
    assert_recorded_outputs(tmp_path / "part.fmu", exported, recorded)


@NIGHTLY
def test_fmi_2_has_recorded_outputs(tmp_path: Path) -> None:
    recorded = RecordedPorts(config_of(**ONE_FAILURE))
    path = tmp_path / "vehicle.fmu"
    export_fmu(recorded.config, "vehicle", path, 2)
    assert validate_fmu(str(path)) == []
    names = [f"{SPEED}[{k}]" for k in range(4)]
    result = simulate_fmu(str(path), output=names, stop_time=(recorded.ticks - 1) * TICK, output_interval=TICK)
    speeds = np.array([result[name] for name in names]).T
    column = [v.name for v in read_model_description(str(path)).modelVariables if v.name.startswith("truth.")]
    first = column.index(names[0])
    assert np.array_equal(speeds, [recorded.latest("truth", k)[first : first + 4] for k in range(recorded.ticks)])


@NIGHTLY
@pytest.mark.parametrize("part", ["plant", "vehicle"])
def test_library_has_recorded_outputs(part: str, tmp_path: Path) -> None:
    native, recorded = built(tmp_path, "delivery_mission", part, **SCENE, **{"multibody.event": FAILURES})
    native.compare(recorded, 0, recorded.ticks)
    assert native.call("missed")(native.instance) == 0


@NIGHTLY
def test_vehicle_of_fleet_fails_alone(tmp_path: Path) -> None:
    failing = {"vehicle.0.model": "multibody", "vehicle.0.multibody.event": ONE_FAILURE["multibody.event"]}
    native, recorded = built(tmp_path, "fleet", "plant", **failing, **{"run.duration": 2.8, "success.require": "[]"})
    native.compare(recorded, 0, recorded.ticks)


def test_step_ends_early_at_each_failure(vehicle: Path) -> None:
    a = begun(vehicle, eventModeUsed=True, earlyReturnAllowed=True)
    times, reached, end = [], 0.0, 2.7
    while reached < end:
        event, terminate, early, reached = a.fmu.doStep(reached, end - reached)
        assert event == early
        assert not terminate
        if event:
            times.append(reached)
            a.fmu.enterEventMode()
            a.fmu.updateDiscreteStates()
            a.fmu.enterStepMode()
        if reached == pytest.approx(FIRST):
            assert a.get(f"{SPEED}[1]") == pytest.approx(0.0, abs=1e-9)
            assert a.get(f"{SPEED}[3]") > 100.0
    assert [t for t in times if t > 2.5] == pytest.approx([FIRST, SECOND])  # before: the take-off
    assert a.get(f"{SPEED}[3]") == 0.0
    a.close()


def test_step_reports_failure_without_early_return(vehicle: Path) -> None:
    a, b = begun(vehicle), begun(vehicle, eventModeUsed=True, earlyReturnAllowed=False)
    expected = stepped(a, 675)
    b.fmu.doStep(0.0, 2.6)
    event, _, early, reached = b.fmu.doStep(2.6, 0.1)
    assert (event, early, reached) == (True, False, 2.7)
    assert height_and_speeds(b) == expected[-1]
    for each in (a, b):
        each.close()


def test_event_mode_announces_next_failure(vehicle: Path) -> None:
    """Steps that end at the announced times need no early return."""
    a = Slave(vehicle, eventModeUsed=True, earlyReturnAllowed=False)
    a.begin()
    announced, reached = [], 0.0
    while (update := a.fmu.updateDiscreteStates())[4]:
        announced.append(update[5])
        a.fmu.enterStepMode()
        event, _, early, reached = a.fmu.doStep(reached, announced[-1] - reached)
        assert (event, early, reached) == (True, False, announced[-1])
        a.fmu.enterEventMode()
    assert announced == pytest.approx([FIRST, SECOND])
    assert a.get(f"{SPEED}[1]") == pytest.approx(0.0, abs=1e-9)
    assert a.get(f"{SPEED}[3]") == 0.0
    a.close()


def test_saved_states_continue_before_and_after_failure(vehicle: Path) -> None:
    """The state does not depend on the failures that its instance has had."""
    a = begun(vehicle)
    stepped(a, 640)
    before = a.saved()
    first = stepped(a, 11)  # to the tick of the first failures
    between = a.saved()
    rest = stepped(a, 40)
    fresh = begun(vehicle)
    fresh.load(between)
    assert fresh.saved() == between
    fresh.time = 651 * TICK
    assert stepped(fresh, 40) == rest
    for each in (a, fresh):  # back to intact propellers
        each.load(before)
        each.time = 640 * TICK
        assert stepped(each, 51) == first + rest
        each.close()


def test_parameters_after_failure_have_their_own_names() -> None:
    part = export_part(config_of(), "plant")
    names = {leaf.path.partition("|")[0] for leaf in part.image.leaves}
    assert {"plant", "plant.from_tick_651", "plant.from_tick_652", "plant.from_tick_653"} <= names
    assert part.events == [651, 652]

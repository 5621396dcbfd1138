"""FMUs for scheduled execution: partitions at the ticks of periodic, countdown and triggered clocks."""

import subprocess
import sys
from pathlib import Path

import pytest
from clock_fmu import write_clock_fmu
from opened_fmu import OpenedFmu

pytest.importorskip("fmpy")

from lapwing import read_log
from lapwing.services.fmu.host_process import HostError

HOVER = Path("lapwing/scenes/hover.toml").resolve()
TICKS = ["periodic_ticks", "triggered_ticks", "countdown_ticks"]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    result = tmp_path_factory.mktemp("clocks") / "clocks.fmu"
    write_clock_fmu(result)
    return result


def test_periodic_clock_samples_its_inputs(path: Path) -> None:
    """Between two ticks of 0.1 s the outputs are held; an output clock is 1 at its ticks only."""
    fmu = OpenedFmu(path, ["y", "periodic_ticks", "even"], ["u"])
    results = [fmu.initialise(0.0), *(fmu.advance(0.05 * k, float(k)) for k in range(1, 9))]
    assert results == [(k - k % 2, k // 2 + 1, k % 4 == 2) for k in range(9)]


def test_triggered_clock_ticks_while_its_column_is_not_zero(path: Path) -> None:
    fmu = OpenedFmu(path, TICKS, ["triggered"])
    values = [1.0, 0.0, 0.0, -1.0, 1.0, 0.0]
    results = [fmu.initialise(values[0]), *(fmu.advance(0.05 * k, values[k]) for k in range(1, 6))]
    assert [count for _, count, _ in results] == [1, 1, 1, 2, 3, 3]


@pytest.mark.parametrize(("wait", "tick"), [(0.0, 4), (0.05, 5), (0.2, 8)])
def test_countdown_clock_ticks_after_its_interval(path: Path, wait: float, tick: int) -> None:
    """Partition 1 starts the countdown at its third tick, t = 0.2 s."""
    fmu = OpenedFmu(path, TICKS, start={"wait": wait})
    results = [fmu.initialise(), *(fmu.advance(0.05 * k) for k in range(1, 11))]
    assert [count for _, _, count in results] == [float(k >= tick) for k in range(11)]


def test_partitions_of_one_tick_run_by_priority(path: Path) -> None:
    """Priorities 1, 2 and 0: the countdown, which partition 1 starts, runs before the triggered partition."""
    fmu = OpenedFmu(path, ["order"], ["triggered"], start={"wait": 0.0})
    orders = [fmu.initialise(1.0), *(fmu.advance(0.05 * k, 1.0) for k in range(1, 5))]
    assert [order for (order,) in orders] == [12, 2, 12, 2, 132]


def test_countdown_between_two_ticks_is_error(path: Path) -> None:
    fmu = OpenedFmu(path, TICKS, start={"wait": 0.07})
    fmu.initialise()
    for k in range(1, 6):
        fmu.advance(0.05 * k)
    with pytest.raises(HostError, match=r"clock countdown is due at t = 0\.27 s, between two ticks"):
        fmu.advance(0.3)


def test_failing_partition_is_error(path: Path) -> None:
    fmu = OpenedFmu(path, TICKS, start={"wait": -1.0})
    with pytest.raises(HostError, match="activateModelPartition failed with status 3"):
        fmu.initialise()


SERVICE = """
[services.clocks]
fmu = "clocks.fmu"
[services.clocks.inputs]
u = "truth.position_world.2"
triggered = "truth.ground_contact"
[services.clocks.outputs]
"trajectory.position_world.0" = "y"
"trajectory.position_world.1" = "periodic_ticks"
"""


def run_command(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "lapwing", *arguments], capture_output=True, text=True, check=False)


def write_scene(folder: Path) -> Path:
    scene = folder / "clocks.toml"
    scene.write_text(HOVER.read_text() + SERVICE)
    return scene


def fly(folder: Path) -> subprocess.CompletedProcess[str]:
    scene = write_scene(folder)
    options = ["--mode", "single-process", "--set", "run.duration=0.4", "--set", "success.require=[]"]
    return run_command("run", str(scene), "--allow-code", "--log", str(folder / "a.mcap"), *options)


def test_fmu_flies_and_is_resimulated(tmp_path: Path) -> None:
    """Ticks at 8 ms, 28 ms, ... of a run of 4 ms."""
    write_clock_fmu(
        tmp_path / "clocks.fmu", 'intervalVariability="fixed" resolution="1000" intervalCounter="20" shiftCounter="8"'
    )
    done = fly(tmp_path)
    assert done.returncode == 0, done.stderr
    values = read_log(tmp_path / "a.mcap").topic("custom_sensor/trajectory_clocks").values
    counts = [(4 * k - 8) // 20 + 1 for k in range(len(values))]
    assert values[:, 1].tolist() == [max(n, 0) for n in counts]
    done = run_command("resimulate", str(tmp_path / "a.mcap"), "--allow-code")
    assert done.returncode == 0, done.stderr
    assert "is identical" in done.stdout


@pytest.mark.parametrize(
    ("periodic", "message"),
    [
        (
            'intervalVariability="constant" intervalDecimal="0.003"',
            "clock periodic has the interval 0.003 s; expected a",
        ),
        (
            'intervalVariability="constant" intervalDecimal="0.1" shiftDecimal="0.001"',
            "clock periodic has the shift 0.001 s; expected a multiple of the tick, 0.004 s",
        ),
        ('intervalVariability="fixed"', "clock periodic has no interval in modelDescription.xml; expected interval"),
        ('intervalVariability="tunable" intervalDecimal="0.1"', "clock periodic has the interval variability tunable"),
        ('intervalVariability="constant" intervalDecimal="a"', "not an FMU: could not convert string to float"),
    ],
)
def test_clock_that_cannot_tick_is_rejected_by_name(tmp_path: Path, periodic: str, message: str) -> None:
    write_clock_fmu(tmp_path / "clocks.fmu", periodic)
    done = fly(tmp_path)
    assert done.returncode == 2
    assert "services.clocks.fmu: " in done.stderr
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def test_clock_with_ticks_of_its_own_is_no_input(tmp_path: Path) -> None:
    write_clock_fmu(tmp_path / "clocks.fmu")
    scene = write_scene(tmp_path)
    scene.write_text(scene.read_text().replace("triggered = ", "periodic = "))
    done = subprocess.run(
        [sys.executable, "-m", "lapwing", "check", str(scene)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "services.clocks.inputs.periodic: periodic is a clock with its own ticks; expected a" in done.stderr

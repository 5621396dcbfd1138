"""Command line: every user error is one line with exit code 2 and leaves no files."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import lapwing
from lapwing.cli.app import FIRST, GROUPS
from lapwing.cosim.transport.bus_keys import check_key_prefix
from tests.commands import assert_rejected, run_command

ROOT = Path.cwd()
HOVER, DELIVERY = "scenes/hover.toml", "scenes/delivery_mission.toml"
PEERS = "plant=tcp/127.0.0.1:7001,autopilot=tcp/127.0.0.1:7002"

OPEN = ("--endpoints", "foxglove=unixsock-stream/x")

BAD = {
    "unknown key": ([HOVER, "--set", "run.sed=1"], "--set run.sed: unknown key 'sed'; did you mean seed?"),
    "own effect": ([HOVER, "--set", "effects.gravty={}"], 'an effect of your own needs `module = "FILE"`'),
    "no value": ([HOVER, "--set=run.seed"], "--set run.seed: expected KEY=VALUE, for example solver.step=0.001"),
    "key of another option": (
        ["gyrostat_chaotic", "--shell", "--mode", "single-process"],
        "override autopilot.shell: autopilot: the model gyrostat has no such table",
    ),
    "no number": ([HOVER, "--run", "abc"], "--run abc: expected a valid integer (see lapwing run --help)"),
    "list": ([HOVER, "--set", 'success.require="time"'], "--set success.require: expected a list, got 'time'"),
    "success": ([HOVER, "--set", 'success.require=["tim < 3"]'], "unknown metric 'tim'; did you mean time?"),
    "no outcome": (
        [HOVER, "--set", "success.require=[\"outcome == 'landde'\"]"],
        "'landde' is not an outcome; did you mean landed?",
    ),
    "no condition": ([HOVER, "--set", 'success.require=["rmse.z"]'], "'rmse.z' is a number, not true or false"),
    "text without quotes": (
        [HOVER, "--set", 'success.require=["outcome == landed"]'],
        "'landed' is a text without quotes",
    ),
    "unlike types": ([HOVER, "--set", "success.require=[\"'a' < 1\"]"], "is a text, '1' is a number"),
    "zero divisor": ([HOVER, "--set", 'success.require=["1/0 > 1"]'], "cannot be computed: division by zero"),
    "no expression": ([HOVER, "--set", 'success.require=["exit()"]'], "expected an expression over metrics of the"),
    "run alone": ([HOVER, "--run", "3"], "--run and --campaign: belong together; expected both"),
    "no campaign": ([HOVER, "--run", "3", "--campaign", "scenes"], "scenes: not a campaign; expected a folder"),
    "missing file": (["scenes/hovr.toml"], "scenes/hovr.toml: no such file or directory; did you mean scenes/hover"),
    "folder": (["scenes"], "scenes: is a folder; expected a scene file"),
    "log": ([HOVER, "--log", "none/a.mcap"], "none/a.mcap: cannot be written: there is no folder none; create it"),
    "log is a folder": ([HOVER, "--log", "scenes"], "scenes: is a folder"),
    "log is the scene": ([HOVER, "--log", HOVER], "is the same file as SCENE"),
    "json": ([HOVER, "--json", "none/a.json"], "none/a.json: cannot be written: there is no folder none; create it"),
    "json is the log": ([HOVER, "--json", "a", "--log", "a"], "--json a: is the same file as --log"),
    "speed 0": ([HOVER, "--speed", "0"], "--speed 0: expected a number above 0, or max"),
    "speed nan": ([HOVER, "--speed", "nan"], "--speed nan: expected a number above 0, or max"),
    "speed fast": ([HOVER, "--speed", "fast"], "--speed fast: expected a number above 0, or max"),
    "mode": ([HOVER, "--mode", "both"], "--mode both: expected multi-process or single-process"),
    "no network": ([HOVER, "--mode", "single-process", "--endpoints", PEERS], "--mode single-process: has no network"),
    "empty peers": ([HOVER, "--endpoints", ""], "--endpoints : expected name=endpoint,..."),
    "peers": ([HOVER, "--endpoints", "x"], "--endpoints x: expected name=endpoint,..."),
    "peers' endpoint": ([HOVER, "--endpoints", "plant=x"], "--endpoints x: expected an endpoint protocol/address:port"),
    "too few peers": ([HOVER, "--endpoints", PEERS, "--insecure"], "no endpoint for trajectory, recorder, mission"),
    "open door": (
        [HOVER, "--listen", "tcp/0.0.0.0:1"],
        "--listen tcp/0.0.0.0:1: endpoint is not authenticated; use tls/",
    ),
    "no keys": ([HOVER, "--listen", "tls/0.0.0.0:1"], "needs certificates; use --keys FOLDER"),
    "viewers": (
        [HOVER, "--foxglove", "0.0.0.0:8799"],
        "--foxglove 0.0.0.0:8799: any program there could read the run; expected",
    ),
    "view alone": ([HOVER, "--mode", "single-process", "--view"], "--view: needs --mode multi-process"),
    "ROS 2 alone": ([HOVER, "--mode", "single-process", "--ros2", "0"], "--ros2: needs --mode multi-process"),
    "ROS 2 in a scene": (
        [HOVER, "--mode", "single-process", "--set", "ros2.enabled=true"],
        "--ros2: needs --mode multi-process",
    ),
    "ROS 2 domain": ([HOVER, "--ros2", "233"], "--ros2 233: expected a number less than or equal to 232"),
    "router alone": ([HOVER, "--ros2-router", "127.0.0.1:7447"], "--ros2-router 127.0.0.1:7447: expected with --ros2"),
    "router elsewhere": ([HOVER, "--ros2", "0", "--ros2-router", "robot:7447"], "robot:7447: programs of that host"),
    "program": ([HOVER, "--external", "autopilot=tcp/[::1]:1"], "use unixsock-stream/PATH in a folder of your"),
    "real time": ([HOVER, "--realtime", "--speed", "max"], "--realtime: needs a limited speed"),
    "keys": ([HOVER, "--keys", "x"], "--keys: expected with --listen or --endpoints"),
    "door": ([HOVER, "--listen", "x"], "--listen x: expected an endpoint protocol/address:port"),
    "option": ([HOVER, "--lgo", "x"], "--lgo: unknown option; did you mean --log? (see lapwing run --help)"),
    "slow": (
        [HOVER, "--speed", "1e-9"],
        "--speed 1e-9: a tick of 0.004 s would take over 1 s; expected at least 0.004",
    ),
    "slow scene": ([HOVER, "--set", "run.real_time_factor=1e-300"], "run.real_time_factor 1e-300: a tick of 0.004 s"),
    "dash": ([HOVER, "--json", "-"], "-: standard output is not supported here; expected the path of an output"),
    "key prefix": ([HOVER, "--key-prefix", "a b"], "--key-prefix a b: expected letters"),
    "no scene": ([], "SCENE: missing (see lapwing run --help)"),
}


@pytest.mark.parametrize(("arguments", "expected"), BAD.values(), ids=BAD)
def test_invalid_run_is_rejected_in_one_line(lapwing, arguments, expected):
    done = lapwing("run", *arguments)
    assert_rejected(done, expected)
    assert done.stdout == ""
    assert os.listdir() == ["scenes"]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["check", "scenes/none.toml"], "no such file"),
        (["accuracy", "hovr"], "unknown scene or problem 'hovr'; did you mean hover? expected a scene (see lapwing sc"),
        (["accuracy", "heavy_to"], "unknown scene or problem 'heavy_to'; did you mean heavy_top? expected a scene"),
        (["accuracy", "heavy_top", "--set", "run.seed=2"], "--set run.seed=2: heavy_top is a problem; expected a sc"),
        (["precompile", "scenes/none.toml"], "no such file"),
        (["precompile", "scenes/plans"], "scenes/plans: contains no scenes; expected a folder with .toml files"),
        (["scenes", "none"], "none: contains no scenes"),
        (["report", "none.mcap"], "none.mcap"),
        (["report", "none.mcap", "--out", "a.txt"], "--out a.txt: expected a name that ends in .html, .pdf or .png"),
        (["report", "none.mcap", "none.mcap"], "the second FILE none.mcap: is the same file as FILE; choose another"),
        (["run", "hover", "--report", "a.txt"], "--report a.txt: expected a name that ends in .html, .pdf or .png"),
        (["replay", "none.mcap"], "none.mcap"),
        (["replay", "none.mcap", "--listen", "x"], "--listen x: expected an endpoint protocol/address:port"),
        (["replay", "none.mcap", "--listen", "tcp/0.0.0.0:7999"], "tcp/0.0.0.0:7999: endpoint is not authenticated"),
        (["replay", "none.mcap", "--listen", "tcp/[::]:7999"], "127.0.0.1:7447, or --insecure"),
        (["replay", "none.mcap", "--listen", "tcp/[::1]:7999"], "none.mcap: cannot be read: no such file"),
        (["replay", "none.mcap", "--listen", "tcp/localhost:7999"], "none.mcap: cannot be read: no such file"),
        (["replay", "none.mcap", "--listen", "unixsock-stream/x"], "none.mcap: cannot be read: no such file"),
        (
            ["replay", "none.mcap", "--listen", "tcp/0.0.0.0:7999", "--insecure"],
            "none.mcap: cannot be read: no such file",
        ),
        (
            ["replay", "none.mcap", "--foxglove", "[::]:8799"],
            "--foxglove [::]:8799: any program there could read the run",
        ),
        (
            ["service", "foxglove", HOVER, *OPEN, "--foxglove", "0.0.0.0:8765"],
            "any program there could read the run; expected",
        ),
        (["service", "plnt", HOVER, "--endpoints", PEERS], "unknown service plnt; expected one of"),
        (["service", "sensors", HOVER, "--endpoints", PEERS], "no endpoint for sensors itself"),
        (
            ["service", "plant", HOVER, "--endpoints", PEERS, "--key-prefix", "a b"],
            "--key-prefix a b: expected letters",
        ),
        (["protocol", HOVER, "--plot", "a.txt"], "--plot a.txt: unknown format; use a name that ends in .png"),
        (["protocol", HOVER, "--plot", "a.svg", "--json", "a.svg"], "--plot a.svg: is the same file as --json"),
        (["campaign", HOVER, "--out", "-"], "-: standard output is not supported here"),
        (["certificates", "-"], "-: standard output is not supported here"),
        (["export-library", HOVER, "--out", "-"], "-: standard output is not supported here"),
        (["campaign", HOVER, "--vary", "vehicle.mas=normal(9,1)"], "--vary vehicle.mas: unknown key 'mas'; did you"),
        (["fly"], "fly: unknown command (see lapwing --help)"),
        (["runn"], "runn: unknown command; did you mean run? (see lapwing --help)"),
        (["new"], "COMMAND: missing (see lapwing new --help)"),
        (["check", "hover", "more"], "more: unexpected argument (see lapwing check --help)"),
        (["info", "a.mcap", "--log"], "--log: unknown option (see lapwing info --help)"),
        (["import", "a.ulg"], "--out: missing (see lapwing import --help)"),
        (["import", "a.ulg", "--out"], "--out: expected a value (see lapwing import --help)"),
        (["run", "hover", "--view=1"], "--view: takes no value (see lapwing run --help)"),
    ],
)
def test_other_invalid_commands_are_rejected_in_one_line(lapwing, arguments, expected):
    done = lapwing(*arguments)
    assert_rejected(done, expected)
    assert done.stdout == ""
    assert os.listdir() == ["scenes"]


@pytest.mark.parametrize("key_prefix", ["", "a b", "a/*", "/a", "a/", "$x", "ä"])
def test_invalid_key_prefix_is_rejected(key_prefix):
    with pytest.raises(ValueError, match="--key-prefix"):
        check_key_prefix(key_prefix)


def test_version(lapwing):
    code, out, err = lapwing("--version")
    assert (code, err) == (0, "")
    assert out.startswith("lapwing ")


def test_help_lists_commands_in_groups_on_single_lines():
    command = [sys.executable, "-m", "lapwing", "--help"]
    result = subprocess.run(command, env=os.environ | {"COLUMNS": "80"}, capture_output=True, text=True, check=True)
    lines = result.stdout.split("Start here:\n")[1].splitlines()
    examples = [line.strip() for line in lines if line.strip().startswith("lapwing ")]
    rows = [line for line in lines if line.startswith("  ") and line.strip() not in examples]
    assert [line.split()[0] for line in rows] == [name for group in GROUPS.values() for name in group]
    assert all(line.endswith(".") and len(line) <= 80 for line in rows)
    assert examples == list(FIRST.values())
    assert len(FIRST) == 8
    assert "Other:" not in result.stdout
    without = subprocess.run(
        command[:-1], env=os.environ | {"COLUMNS": "80"}, capture_output=True, text=True, check=True
    )
    assert without.stdout == result.stdout


def test_help_of_new_is_not_cut_off(lapwing):
    code, out, _ = lapwing("new", "--help")
    rows = out.partition("Commands:\n")[2].splitlines()
    assert (code, len(rows)) == (0, 7)
    assert [row for row in rows if row.endswith("...")] == []


def test_scenes_and_broken_scenes_are_listed_on_one_line_each(lapwing, tmp_path):
    (tmp_path / "broken.toml").write_text("[run\n")
    code, out, _ = lapwing("scenes")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()] == sorted(p.stem for p in Path("scenes").glob("*.toml"))
    assert "hover: up 1 m" in out
    _, out, _ = lapwing("scenes", "scenes")
    assert [line.split()[0] for line in out.splitlines()] == sorted(map(str, Path("scenes").glob("*.toml")))
    _, out, _ = lapwing("scenes", ".")
    assert out.startswith("broken.toml  (broken: broken.toml: not valid TOML: Expected ']'")


def test_check_prints_configuration(lapwing):
    code, out, _ = lapwing("check", HOVER)
    assert code == 0
    assert out.splitlines() == [
        f"{HOVER}: ok",
        "  title     hover: up 1 m, hold 3 s, down; true state, no wind",
        "  vehicle   drone1, delivery_drone",
        "  effects   gravity, ground_contact, rotor_thrust",
        "  sensors   none",
        "  path      4 phases, 9 s, 2 m",
        "  services  plant, trajectory, autopilot; 250 Hz, gauss_seidel",
    ]


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--runs", "0", "--runs 0: expected a number from 1 to 10000000"),
        ("--vary", "vehicle.mass=normal(1", "expected a distribution (normal, lognormal, uniform"),
        ("--vary", "vehicle.mass", "--vary vehicle.mass: expected KEY=DISTRIBUTION"),
    ],
)
def test_campaign_checks_values_before_slow_imports(option, value, message):
    command = [sys.executable, "-X", "importtime", "-m", "lapwing", "campaign", "hover", option, value]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    lines = result.stderr.splitlines()
    modules = {line.rpartition("|")[2].strip() for line in lines if line.startswith("import time:")}
    assert result.returncode == 2
    assert message in lines[-1]
    assert not modules & {"numba", "matplotlib", "lapwing.services.scene_resolver", "scipy.stats"}


@pytest.mark.long
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("run hover --mode single-process --json -", "-: standard output is not supported here"),
        ("run hover --log a.txt", "a.txt: is not the name of a log; expected a name that ends in .mcap"),
        ("run hover --plan no.plan", "no.plan: cannot be read: no such file or directory; expected a mission file"),
        ("performance no.toml", "no.toml: no such file or directory; expected an airframe or scene file"),
        ("check missing_scene.toml", "no such file or directory; expected a scene file (.toml); `lapwing scenes`"),
        ("campaign hover --sweep no.csv", "no.csv: cannot be read: no such file or directory; expected a table"),
        ("validate hover no.csv", "no.csv: no such file or directory; expected a recorded flight"),
        ("check none.mcap", "none.mcap: cannot be read: no such file or directory; expected a log"),
        ("compare none other", "none: no such file or directory; expected the folder of a campaign"),
        ("import flight.csv --out a.mcap --mapping m.toml", "--mapping m.toml: tme: unknown key 'tme'; did you mean"),
        ("import flight.csv --out a.mcap --mapping none.toml", "none.toml: cannot be read: no such file or directory"),
        ("import flight.csv --out a.mcap --mapping nanobench", "flight.csv: none of the mapped columns"),
        ("identify hover flight.csv --out a.toml", "--free: missing; name the keys to estimate"),
        ("identify hover flight.csv --mapping m.toml --free a.b --out a.toml", "--free a.b: no number of this name"),
        ("effects hover --only ,", "--only ',': expected names of effects, separated by commas"),
        ("campaign hover --sweep binary.csv", "binary.csv: cannot be read: not a UTF-8 text file; expected a table"),
        ("export-library hover --out flight.csv", "flight.csv: is a file; expected the path of an output folder"),
    ],
)
def test_process_rejects_input_in_one_line_and_writes_no_file(tmp_path, arguments, message):
    (tmp_path / "m.toml").write_text('[tme]\ncolumn = "t"\nunit = "s"\n')
    (tmp_path / "flight.csv").write_text("a,b\n1,2\n")
    (tmp_path / "binary.csv").write_bytes(b"\xac\xff")
    command, environment = [sys.executable, "-m", "lapwing", *arguments.split()], os.environ | {"PYTHONPATH": str(ROOT)}
    result = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert (result.returncode, result.stdout, result.stderr.count("\n")) == (2, "", 1)
    assert message in result.stderr
    assert sorted(os.listdir(tmp_path)) == ["binary.csv", "flight.csv", "m.toml"]


FULL = Path("/dev/full")


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("arguments", [["scenes"], ["--help"], ["check", "hover"]])
def test_output_to_full_device_is_one_line_and_no_traceback(arguments):
    with FULL.open("w") as full:
        command = [sys.executable, "-m", "lapwing", *arguments]
        result = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert result.returncode == 1
    assert result.stderr == "lapwing: standard output: cannot be written: no space left on device\n"


@pytest.mark.long
def test_full_output_device_leaves_log(tmp_path):
    lapwing.fly("hover", {"run.duration": 0.1})  # compiles, since its notice would be the first failed output
    log = tmp_path / "log.mcap"
    command = [sys.executable, "-m", "lapwing", "run", "hover", "--set", "run.duration=1", "--mode", "single-process"]
    with FULL.open("w") as full:
        result = subprocess.run(
            [*command, "--log", str(log)], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert result.returncode == 1
    assert "Traceback" not in result.stderr
    assert log.stat().st_size > 1000


@pytest.mark.long
@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_processes_fly_with_closed_standard_files(tmp_path, closed):
    lapwing.fly("hover", {"run.duration": 0.1})
    log, report = tmp_path / "log.mcap", tmp_path / "report.html"
    words = f"-m lapwing run hover --set run.duration=1 --log {log} --report {report} {closed}"
    result = subprocess.run(f"{sys.executable} {words}", shell=True, capture_output=True, text=True, check=False)
    assert (result.returncode, "Traceback" in result.stderr) == (0, False)
    assert log.exists()
    assert report.exists()


@pytest.mark.long
def test_study_with_closed_output_keeps_exit_code():
    command = f"{sys.executable} -m lapwing stability exact_time"
    result = subprocess.run(f"{command} >&-", shell=True, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr) == (0, "")


def test_closed_pipe_ends_command_quietly():
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-m", "lapwing", "scenes"]
    result = subprocess.run(command, stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert (result.returncode, result.stderr) == (128 + signal.SIGPIPE, "")


@pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full")
def test_study_writes_its_files_before_its_output(tmp_path):
    script = '"$@" | true'  # ends before the study prints
    run_command("performance", "hover", "--json", tmp_path / "card.json", within=("sh", "-c", script, "sh"))
    assert (tmp_path / "card.json").exists()


def test_exit_code_survives_closed_error_stream():
    with FULL.open("w") as full:
        result = subprocess.run([sys.executable, "-m", "lapwing", "nonsense"], stderr=full, check=False)
    assert result.returncode == 2

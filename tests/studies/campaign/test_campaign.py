"""Campaign of short flights: folder, interruption, workers, repeated run, comparison."""

import errno
import json
import os
import shlex
from pathlib import Path

import pytest
from page_texts import page_text
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.studies import workers
from lapwing.studies.campaign import folder as folder_module
from lapwing.studies.campaign import run_table
from lapwing.studies.campaign.comparison import compare
from lapwing.studies.campaign.distributions import choice, normal, uniform
from lapwing.studies.campaign.folder import begin, manifest, read
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.runs import first_config, fly_runs, reference, row_of
from lapwing.studies.campaign.shard_loop import Count, StoppingRule, campaign
from lapwing.studies.campaign.statistics import interval
from tests.commands import run_command

pytestmark = pytest.mark.long

SCENE = "delivery_mission"  # only its start, with a requirement that some runs miss
SHORT = ("run.duration=3.5", 'success.require=["max_tilt < 0.03"]')
VARY = {"vehicle.mass": normal(10.4, 0.3), "effects.random_wind_force.mean.0": uniform(0.0, 9.0)}
RUNS = 40


def begin_campaign(path, **changes):
    new_plan = plan(**{"path": SCENE, "overrides": SHORT, "runs": RUNS, "vary": VARY, **changes})
    first = reference(*first_config(new_plan))
    return begin(path, new_plan, manifest(new_plan, first)), first


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """Return a complete campaign, flown in this process, and its digest."""
    folder, first = begin_campaign(tmp_path_factory.mktemp("campaign") / "one")
    campaign(folder, first, workers.run_here)
    return folder, folder.finish(csv=True)


def run_lapwing(*arguments):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert "Traceback" not in result.output
    return result.exit_code, result.output


def options(folder, **vary):
    sets = [part for text in SHORT for part in ("--set", text)]
    varied = [part for key, d in (vary or VARY).items() for part in ("--vary", f"{key}={d}")]
    return ["campaign", SCENE, *sets, *varied, "--runs", RUNS, "--out", folder, "--workers", 1]


def test_row_has_drawn_values_and_end_state(complete):
    folder, _ = complete
    rows = [row for page in folder.pages() for row in page]
    assert [row["run"] for row in rows] == list(range(RUNS))
    assert all(row[key] == folder.plan.values(row["run"])[key] for row in rows for key in VARY)
    assert len({row["end_state"] for row in rows}) == RUNS
    assert {row["outcome"] for row in rows} == {"completed"}


def test_interrupted_campaign_continues_with_other_workers(complete, tmp_path):
    folder, first = begin_campaign(tmp_path / "c")
    campaign(folder, first, workers.run_here, shards=range(0, len(folder.shards), 2))
    (tmp_path / "c" / "shards" / ".00001.csv.77").write_text("half written")
    assert len(folder.missing()) == len(folder.shards) // 2
    counts = []
    count = campaign(folder, first, workers.processes(2), counts.append)
    assert (counts[0].runs, counts[-1].runs, count.runs) == (RUNS // 2, RUNS, RUNS)
    assert folder.finish() == complete[1]


@pytest.mark.skipif(not run_table.has_parquet(), reason="pyarrow is not installed: pip install lapwing[campaign]")
def test_parquet_table_has_manifest_in_metadata(complete):
    from pyarrow import parquet

    folder, digest = complete
    result = parquet.read_table(folder.path / "runs.parquet")
    assert result.num_rows == RUNS
    assert (
        result["effects.random_wind_force.mean.0"].to_pylist()
        == folder.arrays()["effects.random_wind_force.mean.0"].tolist()
    )
    about = {name.decode(): text.decode() for name, text in result.schema.metadata.items()}
    assert (about["scene"], about["digest"]) == (SCENE, digest)
    assert json.loads(about["vary"])["vehicle.mass"] == "normal(10.4, 0.3)"
    assert json.loads(about["versions"])["numpy"]


def test_csv_table_is_exact(complete):
    folder, _ = complete
    rows = run_table.read_csv(folder.path / "runs.csv", folder.kinds)
    assert list(run_table.digest_lines(folder.kinds, rows)) == list(
        run_table.digest_lines(folder.kinds, folder.rows(0) + rows[2:])
    )


def test_folder_of_other_campaign_is_rejected_unchanged(complete, tmp_path):
    folder, _ = complete
    before = (folder.path / "campaign.json").read_text()
    for changes, differing in (({"seed": 2}, "seed"), ({"runs": 41}, "runs"), ({"vary": {}}, "vary")):
        with pytest.raises(ValueError, match=f"contains another campaign .*{differing}"):
            begin_campaign(folder.path, **changes)
    assert (folder.path / "campaign.json").read_text() == before
    changed = folder.about | {"sources": folder.about["sources"] | {"a.toml": ""}, "end_state": "other"}
    with pytest.raises(ValueError, match=r"\(differences: a.toml\)"):
        begin(folder.path, folder.plan, changed)
    with pytest.raises(ValueError, match=r"\(differences: final state of run 0\)"):
        begin(folder.path, folder.plan, folder.about | {"end_state": "other"})
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match="contains other files"):
        begin_campaign(tmp_path)
    with pytest.raises(ValueError, match=r"notes.txt: is a file; expected a new folder"):
        begin_campaign(tmp_path / "notes.txt")
    (tmp_path / "c" / "shards").mkdir(parents=True)  # another machine has just started
    assert begin_campaign(tmp_path / "c")[0].missing()


def test_two_machines_may_create_folder_at_once(tmp_path, monkeypatch):
    create = folder_module._create

    def create_twice(path, about):
        create(path, about | other)  # another machine creates it first
        create(path, about | other)

    monkeypatch.setattr("lapwing.studies.campaign.folder._create", create_twice)
    other = {}
    assert len(begin_campaign(tmp_path / "one")[0].missing()) == 20
    other = {"seed": 2}
    with pytest.raises(ValueError, match=r"contains another campaign .*seed"):
        begin_campaign(tmp_path / "two")


def test_shard_option_flies_part_of_runs(complete, tmp_path):
    arguments = ["campaign", "hover", "--set", "run.duration=0.5", "--runs", 5, "--workers", 1, "--out", tmp_path / "c"]
    code, output = run_lapwing(*arguments, "--shard", "2/2")
    assert (code, "2 of 2 flights" in output, "3 shards missing" in output, "nan" in output) == (0, True, True, False)
    run_arguments = [
        "run", "hover", "--set", "run.duration=0.5", "--campaign", tmp_path / "c", "--mode", "single-process",
    ]  # fmt: skip
    reported = {run: run_lapwing(*run_arguments, "--run", run, "--log", tmp_path / "again.mcap")[1] for run in (0, 1)}
    assert f"run 0 of {tmp_path / 'c'}: not recorded in the campaign yet" in reported[0]
    assert f"run 1 of {tmp_path / 'c'}: final state bit-for-bit identical" in reported[1]
    code, output = run_lapwing(*arguments)
    assert (code, "5 of 5 flights" in output) == (0, True)


def test_worker_with_different_results_is_rejected(complete):
    folder, _ = complete
    _, first = begin_campaign(folder.path)
    with pytest.raises(ValueError, match=r"has numpy .*; expected 0.1 as at the start of the campaign"):
        fly_runs(folder.plan, first._replace(versions={**first.versions, "numpy": "0.1"}), 0, 1)
    with pytest.raises(ValueError, match="the end state of run 0 differs"):
        fly_runs(folder.plan, first._replace(end_state="00"), 0, 1)


def test_full_disk_is_one_line_and_keeps_shards(tmp_path, monkeypatch):
    write = run_table.write_csv

    def full(path, *arguments):
        if "00002" in path.name:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(path, *arguments)

    arguments = ["campaign", "hover", "--set", "run.duration=0.5", "--runs", 5, "--workers", 1, "--out", tmp_path / "c"]
    monkeypatch.setattr("lapwing.studies.campaign.run_table.write_csv", full)
    code, output = run_lapwing(*arguments)
    expected = "00002.csv: cannot be written: no space left on device; repeat the command to continue"
    assert (code, expected in output, len(read(tmp_path / "c").missing())) == (1, True, 3)
    monkeypatch.undo()
    code, output = run_lapwing(*arguments)
    assert (code, "5 of 5 flights" in output) == (0, True)


def test_end_at_interval_width_is_independent_of_workers(tmp_path):
    counts = []

    def backwards(call, tasks):
        yield from reversed(list(workers.run_here(call, tasks)))

    for run_tasks in (workers.run_here, backwards):
        folder, first = begin_campaign(tmp_path / run_tasks.__name__)
        counts.append(campaign(folder, first, run_tasks, half_width=0.2))
        assert counts[-1].failure.half_width <= 0.2
    assert counts[0] == counts[1]
    assert 0 < counts[0].runs < RUNS


def test_runs_beyond_interval_width_are_kept(tmp_path):
    def no_workers(call, tasks):
        assert not list(tasks)
        yield from ()

    folder, first = begin_campaign(tmp_path / "all")
    whole = campaign(folder, first, workers.run_here)
    digest = folder.finish()
    shortened = campaign(folder, first, no_workers, half_width=0.2)
    assert shortened.runs < RUNS
    assert folder.finish() != digest
    assert sum(map(len, read(folder.path).pages())) == shortened.runs
    assert not folder.missing()
    _, output = run_lapwing(*options(folder.path), "--ci-half-width", 0.2)
    assert f"--ci-half-width 0.2 is reached after {shortened.runs} of {RUNS} runs" in output
    assert campaign(folder, first, no_workers) == whole
    assert folder.finish() == digest


def test_interval_is_computed_once_per_shard(monkeypatch):
    requested = []
    monkeypatch.setattr(
        "lapwing.studies.campaign.shard_loop.interval", lambda k, n: requested.append(n) or interval(k, n)
    )
    rule, shards = StoppingRule(1e-9), {}
    for shard in range(300):
        shards[shard ^ 1] = Count(10, 9, {"landed": 9, "crashed": 1})  # in pairs, in reverse order
        assert not rule.reached(shards)
    assert requested == list(range(10, 3010, 10))


def test_value_that_no_run_can_have_is_refused_before_the_first_flight(tmp_path):
    own = ("--runs", "4", "--vary", "sensors.gps.preset=choice(rtk,standardd)", "--out", "c")
    done = run_command("campaign", "hover", *own, folder=tmp_path, code=2)
    text = "lapwing: --vary sensors.gps.preset: unknown preset 'standardd'; did you mean standard?"
    assert text in done.stderr
    assert not (tmp_path / "c").exists()


def test_rejected_parameters_are_counted_and_listed(tmp_path):
    code, output = run_lapwing(*options(tmp_path / "c d", **{"vehicle.mass": choice(10.4, -1.0)}))
    assert code == 0
    result = Results(read(tmp_path / "c d"))
    assert 0 < len(result.rejected["run"]) == RUNS - len(result) < RUNS
    assert f"{len(result)} completed, {len(result.rejected['run'])} rejected" in output
    assert result.rejected["outcome_text"][0] == "--vary vehicle.mass: expected a number above 0 [kg], got -1.0"
    run = result.rejected["run"][0]
    assert run_lapwing("run", SCENE, "--run", run, "--campaign", tmp_path / "c d") == (
        2,
        f"lapwing: {result.rejected['outcome_text'][0]}\n",
    )
    assert "The scene rejected the parameters of" in (tmp_path / "c d" / "report.html").read_text()
    assert (
        f"--campaign &#39;{tmp_path}/c d&#39;" in (tmp_path / "c d" / "report.html").read_text()
    )  # quoted for a shell


def test_rejection_text_does_not_depend_on_install_path(tmp_path):
    new_plan = plan(SCENE, SHORT, runs=1, vary={"vehicle.mass": choice(0.1)})
    assert row_of(new_plan, 0)["outcome_text"].startswith(
        "delivery_drone.toml:6: airframe.mass.payload: expected less than total"
    )


def test_report_json_and_repeated_run(complete, tmp_path, monkeypatch):
    folder, digest = complete
    code, output = run_lapwing(*options(folder.path), "--json", tmp_path / "c.json")
    assert (code, digest in output) == (0, True)
    successes = int(Results(folder)["success"].sum())
    assert 0 < successes < RUNS
    reported = json.loads((tmp_path / "c.json").read_text())
    assert (reported["runs"], len(reported["failed"]), reported["digest"]) == (RUNS, RUNS - successes, digest)
    page = page_text(folder.path / "report.html")
    assert all(text in page for text in ("Probability of success", "Sensitivities", "normal(10.4, 0.3)"))
    assert all(f">{head}</th>" in page for head in ("max_distance [m]", "touchdown.speed [m/s]", "max_tilt [°]"))
    worst = Results(folder).worst(1)[0]["run"]
    command = f"lapwing run {SCENE} --run {worst} --campaign {folder.path}"
    assert command in page
    monkeypatch.chdir(tmp_path)
    code, output = run_lapwing(*command.split()[1:], "--mode", "single-process", "--log", "again.mcap")
    assert (code, f"run {worst} of {folder.path}: final state bit-for-bit identical" in output) == (
        4,
        True,
    )  # a failed run
    code, output = run_lapwing("run", SCENE, "--run", RUNS, "--campaign", folder.path)
    assert (code, f"lapwing: run {RUNS}: expected a run of {folder.path}, 0 to 39" in output) == (2, True)
    assert run_lapwing("campaign", folder.path, "--explain", RUNS) == (code, output)
    code, output = run_lapwing("run", "hover", "--run", 1, "--campaign", folder.path)
    assert (code, "differs from the campaign" in output) == (2, True)


def test_failed_run_shrinks_to_least_change(complete, tmp_path, monkeypatch):
    folder, _ = complete
    failed = Results(folder).worst(1)[0]
    code, output = run_lapwing("campaign", folder.path, "--explain", failed["run"], "--json", tmp_path / "e.json")
    assert code == 0
    explanation = json.loads((tmp_path / "e.json").read_text())
    assert explanation["criteria"] == ["max_tilt < 0.03"]
    assert explanation["unneeded"] == ["vehicle.mass"]  # the tilt against the wind decides
    (change,) = explanation["changes"]
    assert change["passes"] < change["least"] < change["drawn"] == failed["effects.random_wind_force.mean.0"]
    command = output.strip().splitlines()[-1]
    assert command == explanation["command"]
    monkeypatch.chdir(tmp_path)
    assert run_lapwing(*shlex.split(command)[1:], "--mode", "single-process", "--log", "least.mcap")[0] == 4
    passing = command.replace(f"mean.0={change['least']}", f"mean.0={change['passes']}")
    assert run_lapwing(*shlex.split(passing)[1:], "--mode", "single-process", "--log", "passing.mcap")[0] == 0
    success = int(Results(folder)["run"][Results(folder)["success"].astype(bool)][0])
    monkeypatch.setattr("lapwing.studies.campaign.explanation.row_of", None)  # the table says it, without a flight
    code, output = run_lapwing("campaign", folder.path, "--explain", success)
    assert (code, f"--explain {success}: the run succeeds; expected a failed run" in output) == (2, True)


def test_comparison_pairs_runs(complete, tmp_path):
    folder, _ = complete
    other, first = begin_campaign(tmp_path / "heavier", overrides=(*SHORT, "autopilot.gains=paper"))
    campaign(other, first, workers.run_here)
    code, output = run_lapwing("compare", folder.path, other.path, "--json", tmp_path / "d.json")
    assert (code, f"{RUNS} pairs of runs" in output) == (0, True)
    assert "differences: autopilot.gains=paper (second only)\n" in output
    first, *_ = output.splitlines()
    assert "tracking error " in first
    assert "first difference: actuators: " in first  # other gains, and nothing else
    assert "…" not in output  # no number is cut at 80 columns
    (row,) = [line.split() for line in output.splitlines() if line.split()[:1] == ["energy"]]
    assert row[:4] == ["energy", "[W", "h]", "*"]
    result = {d["figure"]: d for d in json.loads((tmp_path / "d.json").read_text())["differences"]}
    energy = result["energy"]
    assert [3600.0 * float(text) for text in row[4:]] == pytest.approx(
        [energy["one"], energy["other"], *energy["difference"].values()], rel=0.005
    )
    assert energy["difference"]["value"] == pytest.approx(energy["other"] - energy["one"])
    width = abs(energy["difference"]["high"] - energy["difference"]["low"])
    assert width < 0.5 * Results(folder)["energy"].std()  # both have the same drawn masses
    assert run_lapwing("compare", folder.path, tmp_path)[0] == 2
    laid_out, first = begin_campaign(tmp_path / "laid_out", design="lhs")
    campaign(laid_out, first, workers.run_here)
    drawn_keys = [f"{key} (different values)" for key in sorted(VARY)]
    assert compare(folder.path, laid_out.path).differing == ["design", *drawn_keys]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["hover", "--runs", "0"], "--runs 0: expected a number from 1 to 10000000"),
        (["hover", "--vary", "vehicle.mass"], "--vary vehicle.mass: expected KEY=DISTRIBUTION"),
        (["hover", "--vary", "vehicle.mass=gauss(1)"], "--vary vehicle.mass=gauss(1): expected a distribution"),
        (["hover", "--vary", "vehicle.mas=normal(10,1)"], "--vary vehicle.mas: unknown key 'mas'; did you mean mass?"),
        (["hover", "--vary", "effects.gravity.0=uniform(0,1)"], "lapwing: --vary effects.gravity.0: "),
        (["hover", "--vary", "run.title.a=uniform(0,1)"], "lapwing: --vary run.title.a"),
        (["hover", "--vary", "=uniform(0,1)"], "--vary =uniform(0,1): expected KEY=DISTRIBUTION"),
        (["hover", "--vary", "run.seed=choice(1,2)"], "--vary run.seed: each run has its own seed"),
        (["hover", "--set", "run.seed=4"], "--set run.seed: each run has its own seed"),
        (
            ["hover", "--vary", "vehicle.mass=normal(10,1)", "--vary", "vehicle.mass=uniform(9,10)"],
            "--vary vehicle.mass=uniform(9,10): vehicle.mass already has a distribution",
        ),
        (["hover", "--sweep", "{}.csv"], "lapwing: --sweep: column vehicle.mas: unknown key 'mas'"),
        (["gyrostat_blocked"], "expected a scene whose autopilot follows a [trajectory]"),
        (["hover", "--report", "c.gif"], "--report c.gif: expected a name that ends in .html, .pdf or .png"),
        (["hover", "--ci-half-width", "0.7"], "--ci-half-width 0.7: expected a probability above 0 and below 0.5"),
        (["hover", "--ci-half-width", "0.1", "--shard", "1/2"], "--ci-half-width: needs the results of all runs"),
        (["hover", "--workers", "2", "--cluster", "tcp://127.0.0.1:1"], "--workers: a cluster has its own"),
        (["hover", "--workers", "0"], "--workers 0: expected at least 1"),
        (["hover", "--runs", "4", "--out", "{}", "--shard", "3/500"], "has 4 shards; expected at most I/4"),
        (["hover", "--runs", "4", "--out", "{}", "--shard", "5/4"], "--shard 5/4: expected I/N with I from 1 to N"),
    ],
)
def test_invalid_input_is_one_line(arguments, message, tmp_path):
    (tmp_path / "c.csv").write_text("vehicle.mas,solver.step\n10,0.001\n")
    code, output = run_lapwing("campaign", *(a.replace("{}", str(tmp_path / "c")) for a in arguments))
    assert code == 2
    assert message in " ".join(output.split())
    assert not Path("campaigns").exists()


def run_campaign(*arguments, cwd):
    return run_command("campaign", *arguments, "--workers", "1", "--out", "c", folder=cwd, COLUMNS="80")


def test_resumed_command_counts_all_runs(tmp_path):
    arguments = ("hover", "--runs", "4", "--set", "run.duration=0.5")
    assert run_campaign(*arguments, cwd=tmp_path).returncode == 0
    sorted((tmp_path / "c/shards").glob("*.csv"))[-1].unlink()
    done = run_campaign(*arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "c: 3 of 4 runs were done before" in done.stdout
    assert "4 of 4 flights" in done.stdout


def test_printed_table_fits_80_columns(tmp_path):
    shown = run_campaign("delivery_paper", "--runs", "2", "--set", "run.duration=2", cwd=tmp_path)
    assert shown.returncode == 0, shown.stderr
    heading = shown.stdout.partition("Root-mean-square")[2].partition("\n\n")[0]
    assert "published" in heading
    assert "\u2026" not in shown.stdout
    assert max(map(len, heading.splitlines())) <= 80


def test_workers_fly_module_of_the_scene_folder(tmp_path):
    assert run_command("new", "controller", "my_control", folder=tmp_path).returncode == 0
    own = ("--set", "autopilot.controller=my_control:MyControl", "--set", "run.duration=0.5")
    done = run_command("campaign", "hover", "--runs", "4", "--workers", "2", *own, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "4 of 4 flights" in done.stdout

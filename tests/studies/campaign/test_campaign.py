"""A campaign of short flights: its folder, a stop, other workers, a run flown again, two beside each other."""

import errno
import json
import os
from pathlib import Path

import pytest
from page_texts import page_text
from typer.testing import CliRunner

from lapwing.cli.main import app
from lapwing.studies import workers
from lapwing.studies.campaign import folder as folder_module
from lapwing.studies.campaign import run_table
from lapwing.studies.campaign.campaign_comparison import compare
from lapwing.studies.campaign.distributions import choice, normal, uniform
from lapwing.studies.campaign.folder import begin, manifest, read
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.results import Results
from lapwing.studies.campaign.runs import first_setup, fly_runs, reference, row_of
from lapwing.studies.campaign.shard_loop import Count, Ending, campaign
from lapwing.studies.campaign.statistics import interval

pytestmark = pytest.mark.long

SCENE = "delivery_mission"  # the start of it; some of the runs are said to fail
SHORT = ("run.duration=3.5", 'success.require=["max_tilt < 0.03"]')
VARY = {"vehicle.mass": normal(10.4, 0.3), "effects.random_wind_force.mean.0": uniform(0.0, 9.0)}
RUNS = 40


def started(path, **changes):
    made = plan(**{"path": SCENE, "overrides": SHORT, "runs": RUNS, "vary": VARY, **changes})
    first = reference(*first_setup(made))
    return begin(path, made, manifest(made, first)), first


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A campaign that was flown in one go, in this process; and its digest."""
    folder, first = started(tmp_path_factory.mktemp("campaign") / "one")
    campaign(folder, first, workers.run_here)
    return folder, folder.finish(csv=True)


def lapwing(*arguments):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert "Traceback" not in result.output
    return result.exit_code, result.output


def options(folder, **vary):
    sets = [part for text in SHORT for part in ("--set", text)]
    varied = [part for key, d in (vary or VARY).items() for part in ("--vary", f"{key}={d}")]
    return ["campaign", SCENE, *sets, *varied, "--runs", RUNS, "--out", folder, "--workers", 1]


def test_run_draws_flies_and_is_row(flown):
    folder, _ = flown
    rows = [row for page in folder.pages() for row in page]
    assert [row["run"] for row in rows] == list(range(RUNS))
    assert all(row[key] == folder.plan.values(row["run"])[key] for row in rows for key in VARY)
    assert len({row["end_state"] for row in rows}) == RUNS
    assert {row["outcome"] for row in rows} == {"completed"}


def test_stop_keeps_complete_shards_for_any_workers(flown, tmp_path):
    folder, first = started(tmp_path / "c")
    campaign(folder, first, workers.run_here, part=range(0, len(folder.shards), 2))
    (tmp_path / "c" / "shards" / ".00001.csv.77").write_text("half written")
    assert len(folder.missing()) == len(folder.shards) // 2
    seen = []
    count = campaign(folder, first, workers.processes(2), seen.append)
    assert (seen[0].runs, seen[-1].runs, count.runs) == (RUNS // 2, RUNS, RUNS)
    assert folder.finish() == flown[1]


@pytest.mark.skipif(not run_table.has_parquet(), reason="pyarrow is not installed: pip install lapwing[campaign]")
def test_table_is_parquet_with_its_making_in_metadata(flown):
    from pyarrow import parquet

    folder, digest = flown
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


def test_csv_gives_every_bit_back(flown):
    folder, _ = flown
    rows = run_table.read_csv(folder.path / "runs.csv", folder.kinds)
    assert list(run_table.bits(folder.kinds, rows)) == list(run_table.bits(folder.kinds, folder.rows(0) + rows[2:]))


def test_folder_of_other_campaign_is_rejected_unchanged(flown, tmp_path):
    folder, _ = flown
    before = (folder.path / "campaign.json").read_text()
    for changes, differing in (({"seed": 2}, "seed"), ({"runs": 41}, "runs"), ({"vary": {}}, "vary")):
        with pytest.raises(ValueError, match=f"holds another campaign .*{differing}"):
            started(folder.path, **changes)
    assert (folder.path / "campaign.json").read_text() == before
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match="holds something else"):
        started(tmp_path)
    (tmp_path / "c" / "shards").mkdir(parents=True)  # another machine has just begun
    assert started(tmp_path / "c")[0].missing()


def test_two_machines_may_begin_at_same_moment(tmp_path, monkeypatch):
    make = folder_module._make

    def twice(path, about):
        make(path, about | other)  # another machine is a little faster
        make(path, about | other)

    monkeypatch.setattr("lapwing.studies.campaign.folder._make", twice)
    other = {}
    assert len(started(tmp_path / "one")[0].missing()) == 20
    other = {"seed": 2}
    with pytest.raises(ValueError, match=r"holds another campaign .*seed"):
        started(tmp_path / "two")


def test_part_counts_its_own_runs(flown, tmp_path):
    words = ["campaign", "hover", "--set", "run.duration=0.5", "--runs", 5, "--workers", 1, "--out", tmp_path / "c"]
    code, output = lapwing(*words, "--shard", "2/2")
    assert (code, "2 of 2 flights" in output, "3 shards missing" in output) == (0, True, True)
    again = ["run", "hover", "--set", "run.duration=0.5", "--campaign", tmp_path / "c", "--mode", "single-process"]
    reported = {run: lapwing(*again, "--run", run, "--log", tmp_path / "again.mcap")[1] for run in (0, 1)}
    assert f"run 0 of {tmp_path / 'c'}: not recorded in the campaign yet" in reported[0]
    assert f"run 1 of {tmp_path / 'c'}: final state bit-for-bit identical" in reported[1]
    code, output = lapwing(*words)
    assert (code, "3 of 3 flights" in output) == (0, True)


def test_worker_with_other_numerics_is_rejected(flown):
    folder, _ = flown
    _, first = started(folder.path)
    with pytest.raises(ValueError, match=r"has numpy .*; the campaign was begun with 0.1"):
        fly_runs(folder.plan, first._replace(versions={**first.versions, "numpy": "0.1"}), 0, 1)
    with pytest.raises(ValueError, match="run 0 goes another way there"):
        fly_runs(folder.plan, first._replace(end_state="00"), 0, 1)


def test_full_disk_is_one_line_and_keeps_runs(tmp_path, monkeypatch):
    write = run_table.write_csv

    def full(path, *arguments):
        if "00002" in path.name:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(path, *arguments)

    words = ["campaign", "hover", "--set", "run.duration=0.5", "--runs", 5, "--workers", 1, "--out", tmp_path / "c"]
    monkeypatch.setattr("lapwing.studies.campaign.run_table.write_csv", full)
    code, output = lapwing(*words)
    expected = "00002.csv: cannot be written: no space left on device; the same command goes on where it stopped"
    assert (code, expected in output, len(read(tmp_path / "c").missing())) == (1, True, 3)
    monkeypatch.undo()
    code, output = lapwing(*words)
    assert (code, "3 of 3 flights" in output) == (0, True)


def test_campaign_ends_at_interval_width_with_any_worker(tmp_path):
    counts = []

    def backwards(call, tasks):
        yield from reversed(list(workers.run_here(call, tasks)))

    for fliers in (workers.run_here, backwards):
        folder, first = started(tmp_path / fliers.__name__)
        counts.append(campaign(folder, first, fliers, until=0.2))
        assert counts[-1].failure.half_width <= 0.2
    assert counts[0] == counts[1]
    assert 0 < counts[0].runs < RUNS


def test_runs_beyond_interval_width_are_kept(tmp_path):
    def nobody(call, tasks):
        assert not list(tasks)
        yield from ()

    folder, first = started(tmp_path / "all")
    whole = campaign(folder, first, workers.run_here)
    digest = folder.finish()
    enough = campaign(folder, first, nobody, until=0.2)
    assert enough.runs < RUNS
    assert folder.finish() != digest
    assert sum(map(len, read(folder.path).pages())) == enough.runs
    assert not folder.missing()
    assert campaign(folder, first, nobody) == whole
    assert folder.finish() == digest


def test_how_well_it_is_known_is_asked_once_shard(monkeypatch):
    requested = []
    monkeypatch.setattr(
        "lapwing.studies.campaign.shard_loop.interval", lambda k, n: requested.append(n) or interval(k, n)
    )
    ending, done = Ending(1e-9), {}
    for shard in range(300):
        done[shard ^ 1] = Count(10, 9, (("landed", 9), ("crashed", 1)))  # in pairs, the second first
        assert not ending.reached(done)
    assert requested == list(range(10, 3010, 10))


def test_rejected_parameters_are_counted_and_listed(tmp_path):
    code, output = lapwing(*options(tmp_path / "c d", **{"vehicle.mass": choice(10.4, -1.0)}))
    assert code == 0
    result = Results(read(tmp_path / "c d"))
    assert 0 < len(result.refused["run"]) == RUNS - len(result) < RUNS
    assert f"{len(result)} completed, {len(result.refused['run'])} rejected" in output
    assert result.refused["outcome_text"][0] == "--vary vehicle.mass: expected a number above 0 [kg], got -1.0"
    run = result.refused["run"][0]
    assert lapwing("run", SCENE, "--run", run, "--campaign", tmp_path / "c d") == (
        2,
        f"lapwing: {result.refused['outcome_text'][0]}\n",
    )
    assert "The scene rejected the parameters of" in (tmp_path / "c d" / "report.html").read_text()
    assert (
        f"--campaign &#39;{tmp_path}/c d&#39;" in (tmp_path / "c d" / "report.html").read_text()
    )  # as a shell reads it


def test_rejection_text_does_not_depend_on_install_path(tmp_path):
    made = plan(SCENE, SHORT, runs=1, vary={"vehicle.mass": choice(0.1)})
    assert row_of(made, 0)["outcome_text"].startswith(
        "delivery_drone.toml:6: airframe.mass.payload: expected less than total"
    )


def test_report_json_and_run_flown_again_to_bit(flown, tmp_path, monkeypatch):
    folder, digest = flown
    code, output = lapwing(*options(folder.path), "--json", tmp_path / "c.json")
    assert (code, digest in output) == (0, True)
    good = int(Results(folder)["success"].sum())
    assert 0 < good < RUNS
    reported = json.loads((tmp_path / "c.json").read_text())
    assert (reported["runs"], len(reported["failed"]), reported["digest"]) == (RUNS, RUNS - good, digest)
    page = page_text(folder.path / "report.html")
    assert all(text in page for text in ("Probability of success", "Which parameter matters", "normal(10.4, 0.3)"))
    worst = Results(folder).worst(1)[0]["run"]
    command = f"lapwing run {SCENE} --run {worst} --campaign {folder.path}"
    assert command in page
    monkeypatch.chdir(tmp_path)
    code, output = lapwing(*command.split()[1:], "--mode", "single-process", "--log", "again.mcap")
    assert (code, f"run {worst} of {folder.path}: final state bit-for-bit identical" in output) == (
        4,
        True,
    )  # one that fails
    code, output = lapwing("run", SCENE, "--run", RUNS, "--campaign", folder.path)
    assert (code, f"--run {RUNS}: expected a run of {folder.path}, 0 to 39" in output) == (2, True)
    code, output = lapwing("run", "hover", "--run", 1, "--campaign", folder.path)
    assert (code, "is not what" in output) == (2, True)


def test_two_campaigns_are_compared_run_by_run(flown, tmp_path):
    folder, _ = flown
    other, first = started(tmp_path / "heavier", overrides=(*SHORT, "autopilot.gains=paper"))
    campaign(other, first, workers.run_here)
    code, output = lapwing("compare", folder.path, other.path, "--json", tmp_path / "d.json")
    assert (code, f"{RUNS} pairs of runs" in output) == (0, True)
    assert "the campaigns differ in: overrides\n" in output
    assert "…" not in output  # 80 columns are enough for all numbers
    (row,) = [line.split() for line in output.splitlines() if line.split()[:1] == ["energy"]]
    assert row[:4] == ["energy", "[W", "h]", "*"]
    result = {d["figure"]: d for d in json.loads((tmp_path / "d.json").read_text())["differences"]}
    energy = result["energy"]
    assert [3600.0 * float(text) for text in row[4:]] == pytest.approx(
        [energy["one"], energy["other"], *energy["difference"].values()], rel=0.005
    )
    assert energy["difference"]["value"] == pytest.approx(energy["other"] - energy["one"])
    alone = abs(energy["difference"]["high"] - energy["difference"]["low"])
    assert alone < 0.5 * Results(folder)["energy"].std()  # the masses drawn are the same in both
    assert lapwing("compare", folder.path, tmp_path)[0] == 2
    others, first = started(tmp_path / "laid_out", design="lhs")
    campaign(others, first, workers.run_here)
    drawn = [f"{key} (drawn otherwise)" for key in sorted(VARY)]
    assert compare(folder.path, others.path).differing == ["design", *drawn]


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
        (
            ["hover", "--vary", "run.seed=choice(1,2)"],
            "--vary run.seed: every run has a seed of its own; expected --seed",
        ),
        (["hover", "--set", "run.seed=4"], "--set run.seed: every run has a seed of its own; expected --seed"),
        (
            ["hover", "--vary", "vehicle.mass=normal(10,1)", "--vary", "vehicle.mass=uniform(9,10)"],
            "--vary vehicle.mass=uniform(9,10): vehicle.mass already has a distribution",
        ),
        (["hover", "--sweep", "{}.csv"], "lapwing: --sweep: column vehicle.mas: unknown key 'mas'"),
        (["gyrostat_blocked"], "expected a scene whose autopilot follows a [trajectory]"),
        (["hover", "--report", "c.gif"], "--report c.gif: expected a name that ends in .html, .pdf or .png"),
        (["hover", "--ci-half-width", "2"], "--ci-half-width 2: expected a probability between 0 and 1"),
        (
            ["hover", "--ci-half-width", "0.1", "--shard", "1/2"],
            "--ci-half-width: needs the results of all runs",
        ),
        (["hover", "--workers", "2", "--cluster", "tcp://127.0.0.1:1"], "--workers: a cluster has its own"),
        (["hover", "--workers", "0"], "--workers 0: expected at least 1"),
        (["hover", "--runs", "4", "--out", "{}", "--shard", "3/500"], "has 4 shards; expected at most I/4"),
        (["hover", "--runs", "4", "--out", "{}", "--shard", "5/4"], "--shard 5/4: expected I/N with I from 1 to N"),
    ],
)
def test_bad_input_is_one_line(arguments, message, tmp_path):
    (tmp_path / "c.csv").write_text("vehicle.mas,solver.step\n10,0.001\n")
    code, output = lapwing("campaign", *(a.replace("{}", str(tmp_path / "c")) for a in arguments))
    assert code == 2
    assert message in " ".join(output.split())
    assert not Path("campaigns").exists()

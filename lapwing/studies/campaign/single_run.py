"""Single run of a campaign, to repeat it."""

from pathlib import Path

from lapwing.cosim.scene import Scene
from lapwing.services.scene_resolver import load
from lapwing.studies.campaign.folder import read
from lapwing.studies.campaign.plan import Plan
from lapwing.studies.campaign.runs import REJECTED, Row, name_option_in_errors, scene_of, sources


def plan_of(scene: Path, run: int, folder: Path) -> Plan:
    """Return the plan of a campaign for the repetition of a run.

    Args:
        scene: scene of the campaign.
        run: number of the run.
        folder: folder of the campaign.

    Raises:
        ValueError: the run does not exist, or the scene differs from the campaign's.
    """
    campaign = read(folder)
    if not 0 <= run < campaign.plan.runs:
        raise ValueError(f"run {run}: expected a run of {folder}, 0 to {campaign.plan.runs - 1}")
    plan = campaign.plan._replace(path=str(scene))
    recorded, current = campaign.about["sources"], sources(plan)
    for name in sorted({*recorded, *current}):
        if recorded.get(name) != current.get(name):
            raise ValueError(f"{scene}: {name} differs from the campaign {folder}; expected the original scene")
    return plan


def scene_of_run(scene: Path, run: int, folder: Path) -> Scene:
    """Return the scene of a run with its drawn values. See `plan_of` for arguments and errors."""
    plan = plan_of(scene, run, folder)
    with name_option_in_errors(plan):
        return load(scene_of(plan), plan.overrides_of(run))


def recorded_row(run: int, folder: Path) -> Row | None:
    """Return the row of a run in the table of its campaign; None if it was not flown."""
    campaign = read(folder)
    shard = next(k for k, runs in enumerate(campaign.shards) if run in runs)
    if shard in campaign.missing():
        return None
    return next(row for row in campaign.rows(shard) if row["run"] == run)


def end_state_of(run: int, folder: Path) -> str:
    """Return the end state of a run in its campaign; "" without one."""
    row = recorded_row(run, folder)
    return "" if row is None or row["outcome"] == REJECTED else row["end_state"]

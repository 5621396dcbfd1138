"""Folder of a campaign: manifest, complete shards, and finally the table of runs.

campaign.json      plan, source texts of the scene, versions; its hash identifies the campaign
shards/00007.csv   rows of one shard, written completely or not at all
last_shard         last shard of a table ended by `--ci-half-width`; later shards are kept for a command without it
runs.parquet       all rows in order (runs.csv without pyarrow)
report.html        report
"""

import contextlib
import hashlib
import json
import math
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.cosim.complete_file import complete_file
from lapwing.cosim.output_lock import write_errors
from lapwing.cosim.run_errors import RunFailed
from lapwing.services.common.schemas.run_schema import published_figures
from lapwing.services.common.schemas.success_criteria import Success
from lapwing.studies.campaign import run_table
from lapwing.studies.campaign.distributions import parse
from lapwing.studies.campaign.plan import Plan
from lapwing.studies.campaign.runs import Reference, Row, columns, scene_of, sources, vehicles

MANIFEST = "campaign.json"
LAST_SHARD = "last_shard"
SHARDS = 32  # number of shards of a small campaign
MAX_SHARD_SIZE = 250  # runs in a shard


class Folder:
    """A campaign on disk."""

    def __init__(self, path: Path, plan: Plan, about: dict[str, Any]):
        """Create the object; use `begin` or `read` instead. `about` is the manifest."""
        self.path, self.plan, self.about = path, plan, about

    @cached_property
    def kinds(self) -> dict[str, type]:
        """Type of each column of the table."""
        return columns(self.plan, self.about["vehicles"])

    @cached_property
    def shards(self) -> list[range]:
        """Runs of each shard, determined by the number of runs alone."""
        size = min(math.ceil(self.plan.runs / SHARDS), MAX_SHARD_SIZE)
        return [range(start, min(start + size, self.plan.runs)) for start in range(0, self.plan.runs, size)]

    def missing(self) -> list[int]:
        """Return the numbers of the shards without results."""
        return [k for k in range(len(self.shards)) if not self._shard(k).exists()]

    def write(self, shard: int, rows: list[Row]) -> None:
        """Write the rows of a shard, completely or not at all.

        Raises:
            RunFailed: the file cannot be written.
        """
        with _campaign_file(self._shard(shard)) as file:
            run_table.write_csv(file, self.kinds, [rows])

    def rows(self, shard: int) -> list[Row]:
        """Return the rows of a complete shard."""
        return run_table.read_csv(self._shard(shard), self.kinds)

    def pages(self) -> Iterator[list[Row]]:
        """Yield the rows of each shard in order, up to the first missing shard or the end of the table."""
        last = self._last()
        for shard in range(len(self.shards)):
            if not self._shard(shard).exists() or (last is not None and shard > last):
                return
            yield self.rows(shard)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the columns of the table, shape (n,) each."""
        return run_table.arrays(self.kinds, self.pages())

    def end_after(self, shard: int | None) -> None:
        """End the table with a shard; None: with the last one. Later shards are kept but omitted.

        Raises:
            RunFailed: the folder cannot be written.
        """
        if shard is None:
            (self.path / LAST_SHARD).unlink(missing_ok=True)
            return
        with _campaign_file(self.path / LAST_SHARD) as file:
            file.write_text(f"{shard}\n", encoding="utf-8")

    def _last(self) -> int | None:
        try:
            return int((self.path / LAST_SHARD).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None

    def finish(self, csv: bool = False) -> str:
        """Write the table as Parquet, or as CSV without pyarrow, and return its digest.

        The digest does not depend on number, kind or order of the workers. `csv` also writes CSV.

        Raises:
            RunFailed: a file cannot be written.
        """
        digest = hashlib.blake2b(digest_size=16)
        for page in self.pages():
            for line in run_table.digest_lines(self.kinds, page):
                digest.update(line)
        if run_table.has_parquet():
            about = {name: v if isinstance(v, str) else json.dumps(v) for name, v in self.about.items()}
            with _campaign_file(self.path / "runs.parquet") as file:
                run_table.write_parquet(file, self.kinds, self.pages(), about | {"digest": digest.hexdigest()})
        if csv or not run_table.has_parquet():
            with _campaign_file(self.path / "runs.csv") as file:
                run_table.write_csv(file, self.kinds, self.pages())
        return digest.hexdigest()

    def _shard(self, shard: int) -> Path:
        return self.path / "shards" / f"{shard:05}.csv"


def manifest(plan: Plan, reference: Reference) -> dict[str, Any]:
    """Return the manifest of a campaign as plain data."""
    scene = scene_of(plan)
    data: dict[str, Any] = {
        "scene": scene.name,
        **plan._asdict(),
        "vary": {key: str(distribution) for key, distribution in plan.vary},
        "sources": sources(plan),
        "vehicles": vehicles(plan),
        "published": {} if scene.vehicles else published_figures(scene.resolved),
        "success": list(dict.fromkeys(text for each in scene.each_vehicle for text in each[Success].require)),
        **reference._asdict(),
    }
    return json.loads(json.dumps(data))


def default_path(about: dict[str, Any]) -> Path:
    """Return the default folder of a campaign; equal for equal commands."""
    digest = hashlib.blake2b(json.dumps(about, sort_keys=True).encode(), digest_size=4).hexdigest()
    return Path("campaigns") / f"{about['scene']}_{digest}"


def begin(path: Path, plan: Plan, about: dict[str, Any]) -> Folder:
    """Create or continue the folder of a campaign.

    Raises:
        ValueError: the folder holds another campaign or other files, or cannot be written.
    """
    if not (path / MANIFEST).exists():
        _create(path, about)
    existing = read(path).about  # another machine may have started the campaign
    compared = about.keys() - {"path", "sources", "end_state"}
    differing = [name for name in about if name in compared and existing.get(name) != about[name]]
    before, now = existing.get("sources", {}), about["sources"]
    differing += [name for name in {**before, **now} if before.get(name) != now.get(name)]
    if not differing and existing.get("end_state") != about["end_state"]:
        differing = [f"final state of run {about['run']}"]
    if differing:
        raise ValueError(
            f"{path}: contains another campaign (differences: {', '.join(differing)}); expected a new folder"
        )
    return Folder(path, plan, about)


def _create(path: Path, about: dict[str, Any]) -> None:
    """Create the folder of a campaign."""
    if path.exists() and not path.is_dir():
        raise ValueError(f"{path}: is a file; expected a new folder, or the folder of a campaign")
    if path.exists() and any(not _may_be_new(file) for file in path.iterdir()):
        raise ValueError(f"{path}: contains other files; expected a new folder, or the folder of a campaign")
    with write_errors(path):
        (path / "shards").mkdir(parents=True, exist_ok=True)
        with complete_file(path / MANIFEST) as file:
            file.write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")


def _may_be_new(file: Path) -> bool:
    """Return True if a file may belong to a campaign that another machine is starting."""
    return file.name in ("shards", MANIFEST) or file.name.startswith(f".{MANIFEST}.")


def read(path: Path) -> Folder:
    """Return the folder of an existing campaign.

    Raises:
        ValueError: the folder is not that of a campaign.
    """
    try:
        about = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
        vary = tuple((key, parse(text)) for key, text in about["vary"].items())
        values = {name: about[name] for name in Plan._fields}
        plan = Plan(**values | {"vary": vary, "overrides": tuple(about["overrides"]), "sweep": tuple(about["sweep"])})
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        if not path.exists():
            raise ValueError(f"{path}: no such file or directory; expected the folder of a campaign") from None
        raise ValueError(f"{path}: not a campaign; expected a folder with {MANIFEST}") from None
    return Folder(path, plan, about)


@contextlib.contextmanager
def _campaign_file(path: Path) -> Iterator[Path]:
    """Yield a file as `complete_file` does. Raise RunFailed if it cannot be written."""
    try:
        with complete_file(path) as file:
            yield file
    except OSError as fault:
        reason = (fault.strerror or str(fault)).lower()
        raise RunFailed(f"{path}: cannot be written: {reason}; repeat the command to continue") from None

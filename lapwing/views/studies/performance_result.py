"""Result of `lapwing performance`."""

from collections.abc import Sequence
from pathlib import Path

from lapwing.studies.performance import Row
from lapwing.views.studies.study_result import Rows, StudyResult

LEAST, ENOUGH = 1.0, 1.5  # thrust over weight to hover, and to hold a position in wind and to turn
SUMMED_UP = ("hover time", "maximum payload", "maximum speed")


def result(subject: Path, rows: Sequence[Row]) -> StudyResult:
    """Return the result of a card: what the vehicle can do, and each figure beside the published one."""
    known = {row.name: f"{row.name} {number(row.computed)} {row.unit}" for row in rows if row.computed is not None}
    source, ratio = rows[0].source, next(row.computed for row in rows if row.name == "thrust over weight")
    words, mark = "thrust over weight is unknown", "warn"
    if ratio is not None:
        says = "too little to hover" if ratio < LEAST else "little for wind and turns" if ratio < ENOUGH else "it flies"
        words = f"thrust over weight {number(ratio)}: {says}"
        mark = "bad" if ratio < LEAST else "warn" if ratio < ENOUGH else "good"
    verdict = "; ".join([words, *(known[name] for name in SUMMED_UP if name in known)])
    reason = "reason for difference" if source else "reason"
    heads = [
        "figure",
        "computed",
        *([source] if source else []),
        *([reason] if any(row.reason for row in rows) else []),
    ]
    table = Rows("", *heads, texts=(reason,))
    for row in rows:
        cells = [
            f"{row.name} [{row.unit}]",
            number(row.computed),
            *([number(row.published)] if source else []),
            row.reason,
        ]
        table.add(*cells[: len(heads)])
    data = {"figures": [row._asdict() for row in rows]}
    return StudyResult(f"Performance of {subject.stem}", verdict, mark, tables=(table,), data=data)


def number(value: float | None) -> str:
    """Return a text of three significant digits, without an exponent below a million; "" for None."""
    if value is None:
        return ""
    return f"{value:.0f}" if 100.0 <= abs(value) < 1e6 else f"{value:.3g}"

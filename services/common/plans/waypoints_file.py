"""Reading of .waypoints files (QGC WPL 110), which Mission Planner and MAVProxy save.

Format: MAVLink guide, "File formats". The first row is home, row 0, if it has a waypoint in a global frame: such files
have the conventions of ArduPilot.
"""

from lapwing.services.common.plans.plan_item import PlanItem
from lapwing.services.common.plans.qgc_plan import PlanItems, entry

HEADER = "QGC WPL"
VERSION = "110"
_COLUMNS = 12
_HOME = 16, 0  # command and frame of the row that is home


def read_rows(text: str) -> PlanItems:
    """Return the items of a .waypoints file's content. Raise ValueError (one line) for another content."""
    first, *lines = text.splitlines()
    if first.removeprefix(HEADER).strip() != VERSION:
        raise ValueError(f"{first}: unknown version; expected {HEADER} {VERSION}")
    rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    items, has_home = [], False
    for number, row in enumerate(rows):
        with entry(f"row {number}"):
            if len(row) != _COLUMNS:
                raise ValueError(f"expected {_COLUMNS} columns, got {len(row)}")
            index, _, frame, command = (int(float(value)) for value in row[:4])
            a, b, c, d, latitude, longitude, altitude = map(float, row[4:11])
            if number == 0 and (command, frame) == _HOME:
                has_home = True
                continue
            shown = number if has_home else number + 1
            place = latitude, longitude, altitude
            items.append(PlanItem(shown, index, command, frame, (a, b, c, d), *place, float(row[11]) != 0.0))
    return PlanItems(items, [], [], has_home)

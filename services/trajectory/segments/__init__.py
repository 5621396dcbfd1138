"""Trajectory segments, one file per kind.

To add a kind, add a file with one subclass of `Segment` and a test; scenes refer to it by its `kind`.
"""

from lapwing.dynamics import discovery
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.validation import validated
from lapwing.services.trajectory.segments.segment import Segment

discovery.modules(__name__)
KINDS = {cls.kind_name(): cls for cls in sorted(Segment.__subclasses__(), key=lambda cls: cls.kind_name())}
"""Segment class by kind."""


def choose(table: object) -> Segment:
    """Return the validated segment of a scene table.

    Raises:
        ConfigError: the table has an unknown `kind` or invalid keys.
    """
    if isinstance(table, Segment):
        return table
    if not isinstance(table, dict) or "kind" not in table:
        raise ConfigError("", f"got {table!r}", f"a table with a kind of segment ({', '.join(KINDS)})")
    if not isinstance(table["kind"], str) or table["kind"] not in KINDS:
        raise ConfigError.unknown("kind", "kind of segment", table["kind"], KINDS)
    kind = KINDS[table["kind"]]
    return validated(kind.model_validate, table, kind)

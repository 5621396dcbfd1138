"""Processes of a run, found by their names in /proc."""

from contextlib import suppress
from pathlib import Path

from lapwing.services.process_table import PROCESSES


def participants(launcher):
    """Return the process ids of a launcher's participants, by name."""
    names = {process.name for process in PROCESSES}
    result = {}
    with suppress(OSError):
        for child in Path(f"/proc/{launcher}/task/{launcher}/children").read_text().split():
            with suppress(OSError):
                name = Path(f"/proc/{child}/comm").read_text().strip()
                if name in names:
                    result[name] = int(child)
    return result


def running(process):
    """Return True if a process runs and is not a zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False

"""The processes of a run, found from outside by what the system calls them."""

from contextlib import suppress
from pathlib import Path

from lapwing.services.process_table import PROCESSES


def participants(launcher):
    """Process numbers of a launcher's children that take part, by name."""
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
    """Return whether a process runs; one that ended and waits for its parent does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False

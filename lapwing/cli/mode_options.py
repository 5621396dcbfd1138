"""Which options of `lapwing run` belong to which kind of run."""

from collections.abc import Mapping

MODES = ("processes", "single")
WATCHING = ("--view",)  # what whoever watches a run can do, also where its processes were started by others
# Options of a run that starts its own processes, and what to do in any other
OF_PROCESSES = {
    "--mavlink": "with --peers start the service mavlink instead",
    "--ros2": "with --peers start the service ros2 instead",
    "--external": "with --peers give NAME_messages an endpoint",
    "--foxglove": "with --peers start the service foxglove instead; lapwing replay shows a log",
    "--view": "lapwing view shows the log of any other",
    "--realtime": "--mode single keeps a --speed without it",
}


def check_mode(mode: str, joins: bool, network: bool, given: Mapping[str, object]) -> None:
    """Refuse a mode that is none, and options that do not belong to it.

    Args:
        mode: "processes" or "single".
        joins: whether the services of the run are started by others (`--peers`).
        network: whether others are let in (`--open`).
        given: whether those in `OF_PROCESSES` were given, by name.

    Raises:
        ValueError: which, and what to do instead.
    """
    if mode not in MODES:
        raise ValueError(f"--mode {mode}: expected {' or '.join(MODES)}")
    if mode == "single" and (joins or network):
        raise ValueError("--mode single: has no network; leave out --peers and --open")
    for option, value in given.items():
        if value and (mode == "single" or (joins and option not in WATCHING)):
            raise ValueError(f"{option}: belongs to a run in processes; {OF_PROCESSES[option]}")

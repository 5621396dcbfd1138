"""A recorded run is flown again from its log bit for bit, with the commands at their ticks."""

from flights import UP, command, fly
from rich.console import Console

from services.refly import refly


def test_commands_come_again_at_their_ticks(tmp_path):
    flown = fly(tmp_path, 6, UP | {4: [command("goto", 2.0, 1.0, 3.0)]})
    before, after = refly(flown.path, Console(quiet=True))
    assert before == after == flown.digest

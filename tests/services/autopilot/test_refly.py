"""A recorded run is flown again from its log bit for bit, with the commands at their ticks."""

from pathlib import Path

from flights import UP, command, fly
from rich.console import Console

from services.flight import fly_single
from services.refly import refly
from services.scene import load


def test_commands_come_again_at_their_ticks(tmp_path):
    flown = fly(tmp_path, 6, UP | {4: [command("goto", 2.0, 1.0, 3.0)]})
    before, after = refly(flown.path, Console(quiet=True))
    assert before == after == flown.digest


class Silent:
    """Shows nothing of a run."""

    def begin(self):
        pass

    def show(self, *_):
        pass


def test_a_run_that_listened_to_nobody_is_flown_again_too(tmp_path):
    log = tmp_path / "hover.mcap"
    fly_single(load(Path(__file__).parents[3] / "scenes" / "hover.toml", ["run.duration=2"]), log, None, Silent())
    before, after = refly(log, Console(quiet=True))
    assert before == after

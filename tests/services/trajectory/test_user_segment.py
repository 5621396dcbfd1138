"""Trajectory segments of user modules: stored in the run configuration, checked, and equal to a shipped kind."""

import tomllib

import numpy as np
import pytest

from lapwing.cosim.scene import SceneError
from lapwing.file_schemas.json_schema import scene_schema
from lapwing.services.scene_resolver import from_resolved, load, resolve
from tests.commands import assert_rejected, run_command
from tests.cosim.memory_log import fly

MODULE = '''
from typing import Literal
from lapwing.plugins import Finite, Piece, Positive, Segment

class Line(Segment):
    """Linear motion."""

    kind: Literal["line"] = "line"
    to: Finite
    rate: Positive

    def pieces(self, start):
        duration = abs(self.to - start) / self.rate
        return [Piece(duration, (start, (self.to - start) / duration))]
'''

ACCURACY = ["check", "log.mcap", "--accuracy", "--set", "solver.accuracy=1e-2"]


def scene(folder, module=MODULE, name="line", **keys):
    (folder / "line.py").write_text(module)
    path = folder / "hover.toml"
    path.write_text((load("hover").path).read_text())
    segment = {"kind": "line", "to": 1.0, "rate": 0.25, **keys} | ({"module": name} if name else {"kind": "ramp"})
    phases = [{"name": "up", "z": segment}, {"name": "hold", "duration": 1.0}]
    return load(path, {"trajectory.phase": phases, "run.duration": 1.0})


def test_user_segment_equals_shipped_kind_without_file(tmp_path):
    shipped, user = scene(tmp_path, name=""), scene(tmp_path)
    (tmp_path / "line.py").unlink()
    restored = from_resolved(user.resolved, "hover")
    digests = {fly(resolve(made)).digest for made in (shipped, user, restored)}
    assert len(digests) == 1
    path = resolve(user).services["trajectory"].parameters.core.path
    np.testing.assert_array_equal(path.z.coefficients[0][:2], [0.0, 0.25])


@pytest.mark.parametrize(
    ("keys", "module", "message"),
    [
        ({"rate": -1.0}, MODULE, "trajectory.phase.0.z.rate"),
        ({"kind": "lin"}, MODULE, r"trajectory.phase.0.z.kind.*did you mean line\?"),
        ({}, "1 +", "trajectory.phase.0.z.module: line.py, line 1: invalid syntax"),
        ({}, MODULE.replace("(self.to - start) / duration", "1 / 0"), "module: line: ZeroDivisionError: .*line 14"),
        ({}, MODULE.replace("return [", "return ["[:-1] + "3, ["), "expected a list of Piece"),
        ({}, MODULE.replace('"line"', '"ramp"'), "trajectory.phase.0.z.kind"),
    ],
)  # fmt: skip
def test_invalid_user_segment_is_named(tmp_path, keys, module, message):
    with pytest.raises(SceneError, match=message):
        scene(tmp_path, module, **keys)


@pytest.mark.long
def test_command_resimulates_user_segment_from_log_alone(tmp_path):
    scene(tmp_path)
    keys = '{ kind = "line", module = "line", to = 1.0, rate = 0.5 }'
    phases = f'trajectory.phase=[{{ name = "up", z = {keys} }}]'
    run = ["run", "hover.toml", "--mode", "single-process", "--log", "log.mcap"]
    for command in (
        [*run, "--set", phases, "--set", "run.duration=0.5"],
        ["resimulate", "log.mcap", "--allow-code"],
        [*ACCURACY, "--allow-code"],
    ):
        run_command(*command, code=0, folder=tmp_path)
        (tmp_path / "line.py").unlink(missing_ok=True)
    message = "contains code of its author (modules.line.py); read it, then use --allow-code to run it\n"
    assert_rejected(run_command(*ACCURACY, folder=tmp_path), message)


def test_schema_accepts_user_segment(tmp_path):
    jsonschema = pytest.importorskip("jsonschema")
    table = {"name": "up", "z": {"kind": "line", "module": "line", "to": 1.0, "rate": 0.5}}
    text = tomllib.loads((load("hover").path).read_text()) | {"trajectory": {"phase": [table]}}
    jsonschema.validate(text, scene_schema())
    del table["z"]["module"]
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(text, scene_schema())

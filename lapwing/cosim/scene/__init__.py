"""Scene: one TOML file and the files that it names, read once and converted to frozen, validated values.

Each service declares its tables as `SceneTable` classes; tables that several services read are in `services/common`.
They form a `Vocabulary`. A service gets its settings with `scene[SceneTableClass]`.
"""

from lapwing.cosim.scene.files import Files
from lapwing.cosim.scene.load import from_resolved, load, parse, with_overrides
from lapwing.cosim.scene.overrides import Overrides, with_values
from lapwing.cosim.scene.scene import Scene, SceneTable, Vocabulary
from lapwing.cosim.scene.scene_error import KeyOrigin, SceneError

__all__ = [
    "Files",
    "KeyOrigin",
    "Overrides",
    "Scene",
    "SceneError",
    "SceneTable",
    "Vocabulary",
    "from_resolved",
    "load",
    "parse",
    "with_overrides",
    "with_values",
]

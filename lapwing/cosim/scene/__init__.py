"""A scene: one TOML file and all that it names, read once and turned into frozen, validated values.

Each service declares the tables that it alone reads as `SceneTable` classes in its own `config.py`, those that several
read are in `services/common`. They are handed over as a `Vocabulary`. A service gets its settings with
`scene[SceneTableClass]`.
"""

from lapwing.cosim.scene.files import Files
from lapwing.cosim.scene.load import again, from_resolved, load, parse
from lapwing.cosim.scene.overrides import Overrides
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
    "again",
    "from_resolved",
    "load",
    "parse",
]

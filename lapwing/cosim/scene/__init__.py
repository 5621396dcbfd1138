"""A scene: one TOML file and all that it names, read once and turned into frozen, validated values.

Each service declares the tables that it alone reads as `Section` classes in its own `config.py`, those that several
read are in `services/common`. They are handed over as a `Vocabulary`. A service gets its settings with
`scene[SectionClass]`.
"""

from lapwing.cosim.scene.files import Files
from lapwing.cosim.scene.load import again, from_resolved, load, parse
from lapwing.cosim.scene.overrides import Overrides
from lapwing.cosim.scene.scene import Scene, Section, Vocabulary
from lapwing.cosim.scene.scene_error import SceneError, Source

__all__ = [
    "Files",
    "Overrides",
    "Scene",
    "SceneError",
    "Section",
    "Source",
    "Vocabulary",
    "again",
    "from_resolved",
    "load",
    "parse",
]

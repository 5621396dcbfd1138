"""A scene: one TOML file and all that it names, read once and turned into frozen, validated values.

Each service declares the tables that it alone reads as `Section` classes in its own `config.py`, those that several
read are in `services/common`. They are handed over as a `Vocabulary`. A service gets its settings with
`scene[SectionClass]`.
"""

from cosim.scene.errors import SceneError, Source
from cosim.scene.files import Files
from cosim.scene.load import again, from_resolved, load, parse
from cosim.scene.overrides import Overrides
from cosim.scene.scene import Scene, Section, Vocabulary

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

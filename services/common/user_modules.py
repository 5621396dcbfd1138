"""The texts of the user's own modules, as the set-up carries them."""

from typing import Any, ClassVar

from pydantic import ConfigDict

from lapwing.cosim.config import user_module
from lapwing.cosim.scene import Files, Scene, SceneTable


class Modules(SceneTable):
    """The texts of the user's own modules, by name: what the keys that name one resolve to."""

    TABLE: ClassVar[str] = "modules"
    OPTIONAL: ClassVar[bool] = True
    FROM_FILE: ClassVar[bool] = True
    SHARED: ClassVar[bool] = True
    model_config = ConfigDict(extra="allow", frozen=True)
    __pydantic_extra__: dict[str, str]

    @property
    def texts(self) -> dict[str, str]:
        """By name."""
        return dict(self.__pydantic_extra__)


def embed(tree: dict[str, Any], files: Files, key: str, module: str) -> None:
    """Put the text of a module, and of those beside it that it imports, into the table `modules`.

    Args:
        tree: the scene's data, not yet validated.
        files: of the scene.
        key: dotted key that names the module.
        module: its name.

    Raises:
        KeyedError: there is none, or it cannot be read.
    """
    for name, path in user_module.find(key, module, files.folder).items():
        tree.setdefault(Modules.TABLE, {})[name] = files.text(f"{Modules.TABLE}.{name}", key, path)


def texts(scene: Scene) -> dict[str, str]:
    """The texts that a scene carries, by name."""
    return scene[Modules].texts if scene.has(Modules) else {}

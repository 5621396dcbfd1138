"""Source texts of user modules in the run configuration."""

from typing import Any, ClassVar

from pydantic import ConfigDict

from lapwing.cosim.config import user_module
from lapwing.cosim.scene import Files, Scene, SceneTable


class Modules(SceneTable):
    """Source texts of user modules by name."""

    TABLE: ClassVar[str] = "modules"
    OPTIONAL: ClassVar[bool] = True
    FROM_FILE: ClassVar[bool] = True
    SHARED: ClassVar[bool] = True
    model_config = ConfigDict(extra="allow", frozen=True)
    __pydantic_extra__: dict[str, str]


def embed(tree: dict[str, Any], files: Files, key: str, module: str) -> None:
    """Store the text of a module, and of the neighbouring modules that it imports, in the table `modules`.

    Args:
        tree: scene data, not yet validated.
        files: files of the scene.
        key: dotted key that names the module.
        module: module name.

    Raises:
        ConfigError: the module is missing or cannot be read.
    """
    folder = files.path(key, f"{module}.py").parent
    for name, path in user_module.find(key, module, folder).items():
        tree.setdefault(Modules.TABLE, {})[name] = files.text(f"{Modules.TABLE}.{name}", key, path)


def texts(scene: Scene) -> dict[str, str]:
    """Return the module texts of a scene by name."""
    return dict(scene[Modules].__pydantic_extra__) if scene.has(Modules) else {}

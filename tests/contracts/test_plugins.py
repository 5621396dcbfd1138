"""User modules import only `lapwing` and `lapwing.plugins` from Lapwing."""

import ast
import re
from pathlib import Path

import pytest

import lapwing.plugins
from lapwing.cli.new_command import TEMPLATES, templates

PUBLIC = {"lapwing", "lapwing.plugins", "lapwing.gym"}
TEMPLATE_TEXTS = {
    f"{path.name} {k}": text
    for path in sorted(TEMPLATES.glob("*_test.py.template"))
    for k, text in enumerate(templates(path.name.removesuffix("_test.py.template"), "own"))
}
EXAMPLES = {path.name: path.read_text() for path in sorted(Path("examples").glob("*.py"))}
TUTORIALS = {
    f"{path.name} {k}": text
    for path in sorted(Path("docs/tutorials").glob("*.md"))
    for k, text in enumerate(re.findall(r"```python[^\n]*\n(.*?)```", path.read_text(), re.DOTALL))
}
TEXTS = TEMPLATE_TEXTS | EXAMPLES | TUTORIALS


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_user_modules_import_public_modules_only(text):
    imported = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add(node.module)
    assert {name for name in imported if name.split(".")[0] == "lapwing"} <= PUBLIC


def test_plugin_names_exist():
    for name in dir(lapwing.plugins):
        assert getattr(lapwing.plugins, name) is not None
    with pytest.raises(AttributeError):
        lapwing.plugins.nothing_of_this_name  # noqa: B018

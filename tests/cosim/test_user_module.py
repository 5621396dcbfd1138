"""Modules of the user's own: found, carried as text, run from it."""

import sys

import pytest

from cosim.user_module import find, load
from dynamics.errors import KeyedError


def test_a_module_is_found_beside_the_scene_with_what_it_imports_from_there(tmp_path):
    (tmp_path / "own_law.py").write_text("import math\nfrom own_helper import two\nimport own_missing\n")
    (tmp_path / "own_helper.py").write_text("import own_law\ntwo = 2\n")
    found = find("key", "own_law", tmp_path)
    assert list(found) == ["own_law", "own_helper"]
    assert found["own_helper"] == tmp_path / "own_helper.py"


def test_a_module_is_found_on_pythons_path(tmp_path, monkeypatch):
    (tmp_path / "own_elsewhere.py").write_text("x = 1")
    monkeypatch.syspath_prepend(tmp_path)
    assert find("key", "own_elsewhere", tmp_path / "scenes") == {"own_elsewhere": tmp_path / "own_elsewhere.py"}


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("own_nowhere", "key: no module own_nowhere; expected"),
        ("numpy", "another module has this name; expected a name of its own"),
        ("math", "another module has this name"),
        ("a-b", "expected a name that Python can import, got module 'a-b'"),
    ],
)
def test_a_module_that_cannot_be_is_refused(tmp_path, name, said):
    for taken in ("numpy", "math"):
        (tmp_path / f"{taken}.py").write_text("")
    with pytest.raises(KeyedError) as caught:
        find("key", name, tmp_path)
    assert said in str(caught.value)


def test_the_text_is_what_is_run_with_its_neighbours():
    texts = {"own_first": "from own_second import value\n", "own_second": "value = 3\n"}
    assert load("own_first", texts).value == 3
    assert load("own_first", texts) is sys.modules["own_first"]


def test_another_text_under_the_same_name_is_run_anew():
    load("own_first", {"own_first": "from own_second import value\n", "own_second": "value = 3\n"})
    assert load("own_first", {"own_first": "from own_second import value\n", "own_second": "value = 4\n"}).value == 4


def test_a_damaged_file_of_the_cache_is_mended():
    module = load("own_kept", {"own_kept": "value = 5\n"})
    with open(module.__file__, "w") as file:
        file.write("value = 6\n")
    del sys.modules["own_kept"]
    assert load("own_kept", {"own_kept": "value = 5\n"}).value == 5

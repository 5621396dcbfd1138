"""Discovery of modules by name in a folder; errors for unknown names."""

import sys

import pytest

from lapwing.dynamics import discovery


@pytest.fixture
def package(tmp_path, monkeypatch):
    folder = tmp_path / "discovered"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "second.py").write_text("VALUE = 2")
    (folder / "first.py").write_text("VALUE = 1")
    (folder / "_private.py").write_text("raise RuntimeError")
    (folder / "broken.py").write_text("import nothing_of_that_name")
    monkeypatch.syspath_prepend(tmp_path)
    discovery._names.cache_clear()
    discovery._module.cache_clear()
    yield "discovered"
    for name in [n for n in sys.modules if n.partition(".")[0] == "discovered"]:
        del sys.modules[name]
    discovery._names.cache_clear()
    discovery._module.cache_clear()


def test_names_are_sorted_and_private_modules_left_out(package):
    assert discovery.names(package) == ["broken", "first", "second"]


def test_one_module_is_imported_without_others(package):
    assert discovery.get(package, "first", "thing").VALUE == 1
    assert "discovered.second" not in sys.modules


def test_all_modules_are_found_by_name(package, tmp_path):
    (tmp_path / package / "broken.py").write_text("VALUE = 0")
    result = discovery.modules(package)
    assert [(name, m.VALUE) for name, m in result.items()] == [("broken", 0), ("first", 1), ("second", 2)]
    assert discovery.modules(sys.modules[package]) == result


def test_failed_import_names_module(package):
    with pytest.raises(ImportError, match="nothing_of_that_name"):
        discovery.modules(package)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("frist", "unknown thing 'frist'; did you mean first? (things: broken, first, second)"),
        ("zebra", "unknown thing 'zebra' (things: broken, first, second)"),
        ("_private", "unknown thing '_private' (things: broken, first, second)"),
    ],
)
def test_unknown_name_lists_choices(package, name, message):
    with pytest.raises(ValueError) as raised:
        discovery.get(package, name, "thing")
    assert str(raised.value) == message


def test_choice_from_mapping_lists_choices():
    assert discovery.choose({"a": 1}, "a", "preset") == 1
    with pytest.raises(ValueError, match=r"unknown preset 'b' \(presets: a\)"):
        discovery.choose({"a": 1}, "b", "preset")

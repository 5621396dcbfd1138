"""Scene files that tests write."""

import shutil

import pytest


@pytest.fixture
def write(tmp_path):
    """Return a function that writes a scene file beside a copy of the airframes."""
    shutil.copytree("lapwing/scenes/vehicles", tmp_path / "vehicles")

    def write_(text):
        path = tmp_path / "scene.toml"
        path.write_text(text)
        return path

    return write_

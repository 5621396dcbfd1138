"""The bill of materials and the audit cover the contents of the images."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(not shutil.which("make"), reason="needs make")
@pytest.mark.parametrize("target", ["sbom", "audit"])
def test_every_lock_of_shipped_image_is_read(target):
    command = ["make", "--dry-run", "--no-print-directory", target]
    output = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    locks = {f"deploy/{path.name}" for path in (ROOT / "deploy").glob("requirements*.lock")}
    reads = next(
        line for line in reversed(output.splitlines()) if "--require-hashes" in line and "--requirement" in line
    )
    assert {word for word in reads.split() if word in locks} == locks - {"deploy/requirements-tests.lock"}

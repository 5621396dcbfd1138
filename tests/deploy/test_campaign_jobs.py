"""Job file of a campaign passes all arguments unchanged and runs each part once."""

import json
import os
import subprocess
import sys
from pathlib import Path

DEPLOY = Path(__file__).parents[2] / "deploy"
RECORDER = f"""#!{sys.executable}
import json, os, sys
with open(os.environ["SAID"], "a") as said:
    print(json.dumps(sys.argv), file=said)
"""
WORDS = [
    "hover",
    "--runs",
    "8",
    "--set",
    'success.require=["outcome == \'landed\'", "rmse.z < 0.1"]',
    "--vary",
    "a b=$c",
]


def calls(folder, *command, **environment):
    """Return the argv of each call of `lapwing` and `sbatch`, which are replaced by recorders."""
    output = folder / "said"
    output.unlink(missing_ok=True)
    for name in ("lapwing", "sbatch"):
        (folder / name).write_text(RECORDER + ('print("77")\n' if name == "sbatch" else ""))
        (folder / name).chmod(0o755)
    environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "SAID": str(output), **environment}
    subprocess.run(command, env=environment, check=True, cwd=folder, stdout=subprocess.DEVNULL)
    return [[Path(program).name, *words] for program, *words in map(json.loads, output.read_text().splitlines())]


def test_slurm_submits_parts_and_then_table(tmp_path):
    values = {"PARTS": "3", "DIR": str(tmp_path / "it's here")}
    array, last = calls(tmp_path, str(DEPLOY / "campaign.slurm"), *WORDS, **values)
    assert array[:4] == ["sbatch", "--parsable", "--export=ALL", "--array=1-3"]
    assert last[:4] == ["sbatch", "--export=ALL", "--dependency=afterany:77", "--wrap"]
    for part in (1, 2, 3):
        (flight,) = calls(tmp_path, *array[4:], **values, SLURM_ARRAY_TASK_ID=str(part))
        expected = ["--out", values["DIR"], "--shard", f"{part}/3", "--workers", "1"]
        assert flight == ["lapwing", "campaign", *WORDS, *expected]
    assert calls(tmp_path, "sh", "-c", last[4]) == [["lapwing", "campaign", *WORDS, "--out", values["DIR"]]]

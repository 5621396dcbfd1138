"""Compare digests of scenes under other C libraries, processor features, systems and versions: `make portability`.

    python deploy/portability/compare.py [--seconds S] [--only NAME...] [--python NAME=COMMAND...] [SCENE...]

The reference is this interpreter without any change. Variants of the environment are those of `VARIANTS`; another
system, version of numba or processor is specified by the command that starts its Python, e.g.

    --python "debian13=chroot /srv/trixie /usr/bin/env -C /lapwing PYTHONPATH=/lapwing:/site python3"
    --python "aarch64=qemu-aarch64-static -L /srv/arm64 /srv/arm64/usr/bin/python3"

Such a command runs `deploy/portability/digests.py` in this folder; the environment is passed on.
Exit code 1 if a digest differs or a variant fails.
"""

import argparse
import os
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
WORKER = "deploy/portability/digests.py"
AVX2 = "+avx,+avx2,+fma"
AVX512 = f"{AVX2},+avx512f,+avx512vl,+avx512dq,+avx512bw"
VARIANTS = {
    "libc-without-fma": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX2_Usable,-FMA_Usable"},
    "numpy-without-simd": {"NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX2 FMA3 AVX512F AVX512_SKX"},
    "openblas-nehalem": {"OPENBLAS_CORETYPE": "Nehalem"},
    "openblas-haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "cpu-generic": {"NUMBA_CPU_NAME": "generic"},
    "cpu-sse2": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "+sse2"},
    "cpu-avx2": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": AVX2},
    "cpu-avx512": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": AVX512},
}
LIMIT = 4 * 3600.0  # [s] limit of one variant


def _missing_features(variables: dict[str, str]) -> str:
    """Return the instruction sets of a variant that this processor lacks."""
    present = Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
    features = variables.get("NUMBA_CPU_FEATURES", "").replace("+", "").split(",")
    return ", ".join(feature for feature in features if feature and feature not in present)


def _digests(command: list[str], variables: dict[str, str], words: list[str]) -> dict[str, str]:
    """Return the digest of every scene flown by a variant."""
    run = subprocess.run(
        [*command, WORKER, *words], cwd=ROOT, env={**os.environ, **variables}, capture_output=True, text=True,
        timeout=LIMIT, check=False,
    )  # fmt: skip
    if run.returncode:
        print(f"exit code {run.returncode}: {run.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
    return dict(line.split() for line in run.stdout.splitlines() if len(line.split()) == 2)


def main() -> int:
    """Print a line for each variant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="scene name [default: all]")
    parser.add_argument("--seconds", default="0", help="longest flight [s]; 0 flies whole scenes [default: 0]")
    parser.add_argument(
        "--only", nargs="+", default=list(VARIANTS), choices=list(VARIANTS), help="variants [default: all]"
    )
    parser.add_argument("--python", action="append", default=[], metavar="NAME=COMMAND", help="another interpreter")
    options = parser.parse_args()
    words = [options.seconds, *options.scenes]
    here = [sys.executable]
    expected = _digests(here, {}, words)
    print(f"reference: {len(expected)} scenes", flush=True)
    runs = [(name, here, VARIANTS[name]) for name in options.only]
    for text in options.python:
        name, _, command = text.partition("=")
        runs.append((name, shlex.split(command), {}))
    failed = not expected
    for name, command, variables in runs:
        if missing := _missing_features(variables):
            print(f"{name}: not flown, this processor has no {missing}", flush=True)
            continue
        result = _digests(command, variables, words)
        different = sorted(scene for scene, digest in expected.items() if result.get(scene) != digest)
        failed |= bool(different)
        print(f"{name}: {'different: ' + ', '.join(different) if different else 'equal'}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())

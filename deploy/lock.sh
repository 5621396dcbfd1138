#!/bin/sh
# Pins what the images contain, from the lower bounds in pyproject.toml.
#
#   deploy/lock.sh [PACKAGE]     all anew, or only PACKAGE to its newest version
#
# Writes requirements.lock (what the runtime image holds, and the build backend) and requirements-tests.lock (what the
# tests need on top of it). A local environment gets the same versions by `pip install --constraint`.
set -eu
cd "$(dirname "$0")/.."

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet uv

pin() {
    "$work/venv/bin/uv" pip compile --quiet --no-header --no-annotate --python-version 3.11 "$@"
}
upgrade=--upgrade
[ $# -eq 0 ] || upgrade="--upgrade-package=$1"

if [ "$upgrade" != --upgrade ]; then
    cp deploy/requirements.lock "$work/runtime"
    cat deploy/requirements.lock deploy/requirements-tests.lock > "$work/all"
fi
echo 'setuptools>=77' > "$work/backend.in"
pin "$upgrade" --output-file "$work/runtime" pyproject.toml "$work/backend.in" > /dev/null
pin "$upgrade" --output-file "$work/all" --extra test --constraint "$work/runtime" \
    pyproject.toml "$work/backend.in" > /dev/null

# One sorting order for comm, whatever the locale.
LC_ALL=C sort "$work/runtime" > deploy/requirements.lock
LC_ALL=C sort "$work/all" | LC_ALL=C comm -13 deploy/requirements.lock - > deploy/requirements-tests.lock
wc -l deploy/requirements.lock deploy/requirements-tests.lock

#!/bin/sh
# Pins what the images contain, from the lower bounds in pyproject.toml.
#
#   deploy/lock.sh [PACKAGE]     all anew, or only PACKAGE to its newest version
#
# Writes requirements.lock (what an installation needs, and the build backend) and for each of $MORE what it needs on top
# of it (a Dask cluster and the server for Foxglove, in the image too; the tests, in theirs), each with the hashes of all files
# of that version, for every platform. pip refuses what has another hash. A local environment gets the same versions by `pip install --constraint`.
set -eu
cd "$(dirname "$0")/.."

MORE="cluster foxglove tests"

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/python" -m pip install --quiet uv

pin() {
    "$work/venv/bin/uv" pip compile --quiet --no-header --no-annotate --generate-hashes --python-version 3.11 "$@"
}
upgrade=--upgrade
[ $# -eq 0 ] || upgrade="--upgrade-package=$1"

if [ "$upgrade" != --upgrade ]; then
    cp deploy/requirements.lock "$work/runtime"
    for more in $MORE; do cat deploy/requirements.lock deploy/requirements-$more.lock > "$work/$more"; done
fi
echo 'setuptools>=77' > "$work/backend.in"
pin "$upgrade" --output-file "$work/runtime" pyproject.toml "$work/backend.in" > /dev/null
for more in $MORE; do
    pin "$upgrade" --output-file "$work/$more" --extra ${more%s} --constraint "$work/runtime" \
        pyproject.toml "$work/backend.in" > /dev/null
done

# A package a line, in one sorting order whatever the locale, and a hash a line again.
lines() { sed -e :again -e '/\\$/{N; s/ *\\\n */ /; b again' -e '}' "$1" | LC_ALL=C sort; }
hashes() { sed 's/ --hash/ \\\n    --hash/g'; }
lines "$work/runtime" > "$work/runtime.lines"
hashes < "$work/runtime.lines" > deploy/requirements.lock
for more in $MORE; do
    lines "$work/$more" | LC_ALL=C comm -13 "$work/runtime.lines" - | hashes > deploy/requirements-$more.lock
done
grep -c == deploy/requirements*.lock

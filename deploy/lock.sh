#!/bin/sh
# Pins the packages of the images, from the lower bounds in pyproject.toml.
#
#   deploy/lock.sh [PACKAGE]     update all packages, or only PACKAGE, to the newest version
#
# Writes requirements.lock (`make mission`: an installation with reports, and the build backend), requirements-all.lock
# (what the extra `all` adds), and for each of $MORE the additional packages (a Dask cluster and the Foxglove server in
# the image, the tests in their image), each with the hashes of all files of that version, for every platform. pip
# rejects files with another hash. `pip install --constraint` installs the same versions in a local environment.
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
    cp deploy/requirements.lock "$work/mission"
    cat deploy/requirements.lock deploy/requirements-all.lock > "$work/runtime"
    for more in $MORE; do cat "$work/runtime" deploy/requirements-$more.lock > "$work/$more"; done
fi
echo 'setuptools>=77' > "$work/backend.in"
pin "$upgrade" --output-file "$work/mission" --extra report pyproject.toml "$work/backend.in" > /dev/null
pin "$upgrade" --output-file "$work/runtime" --extra all --constraint "$work/mission" \
    pyproject.toml "$work/backend.in" > /dev/null
for more in $MORE; do
    pin "$upgrade" --output-file "$work/$more" --extra ${more%s} --constraint "$work/runtime" \
        pyproject.toml "$work/backend.in" > /dev/null
done

# One package per line, in a sorting order independent of the locale; then one hash per line again.
lines() { sed -e :again -e '/\\$/{N; s/ *\\\n */ /; b again' -e '}' "$1" | LC_ALL=C sort; }
hashes() { sed 's/ --hash/ \\\n    --hash/g'; }
lines "$work/mission" > "$work/mission.lines"
lines "$work/runtime" > "$work/runtime.lines"
hashes < "$work/mission.lines" > deploy/requirements.lock
LC_ALL=C comm -13 "$work/mission.lines" "$work/runtime.lines" | hashes > deploy/requirements-all.lock
for more in $MORE; do
    lines "$work/$more" | LC_ALL=C comm -13 "$work/runtime.lines" - | hashes > deploy/requirements-$more.lock
done
grep -c == deploy/requirements*.lock

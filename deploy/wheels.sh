#!/bin/sh
# Downloads the pinned wheels to build/wheels, and builds an image of them for the Dockerfile.
#
#   deploy/wheels.sh BASE IMAGE
#
# The host's pip downloads them with the settings of the host (index, proxy, certificates, a folder of wheels), none of
# which enter the Dockerfile, the images or their history. The build then needs no network. Folder and image are kept,
# and replaced when the pins change.
set -eu
cd "$(dirname "$0")/.."

wheels=build/wheels
stamp=$(cat deploy/requirements*.lock deploy/wheels.sh | sha256sum | cut -d ' ' -f 1)
if [ "$(cat build/wheels.stamp 2> /dev/null)" != "$stamp" ]; then
    # Wheels for the image (CPython 3.11 on Debian bookworm, glibc 2.36), not for the host's Python.
    machine=$(uname -m)
    platforms=$(for minor in $(seq 5 36); do printf -- '--platform manylinux_2_%d_%s ' "$minor" "$machine"; done)
    rm -rf "$wheels" build/wheels.stamp
    mkdir -p "$wheels"
    # shellcheck disable=SC2086  # a list of options
    ${PYTHON:-python3} -m pip download --quiet --disable-pip-version-check --no-deps --only-binary :all: \
        --dest "$wheels" --python-version 3.11 --implementation cp --abi cp311 --abi abi3 --abi none \
        $platforms --platform "manylinux2014_$machine" --platform "manylinux1_$machine" \
        $(printf -- '-r %s ' deploy/requirements*.lock)
    echo "$stamp" > build/wheels.stamp
    du -sh "$wheels"
fi
if [ "$(docker image inspect --format '{{.Config.Labels.stamp}}' "$2" 2> /dev/null)" != "$stamp" ]; then
    printf 'FROM %s\nLABEL stamp=%s\nCOPY . /wheels/\n' "$1" "$stamp" > build/wheels.Dockerfile
    docker build --quiet --tag "$2" --file build/wheels.Dockerfile "$wheels" > build/wheels.log 2>&1 ||
        { tail -5 build/wheels.log >&2; exit 1; }
fi

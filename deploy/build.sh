#!/bin/sh
# Builds the images lapwing and lapwing-tests (`make docker-build`), also where no image can be pulled.
#
#   [BASE=IMAGE] [IMAGE=NAME] [PYTHON=python3] deploy/build.sh
set -eu
cd "$(dirname "$0")/.."
. deploy/compose.sh

# The base: the one asked for, else the official one, else one built here from Debian's packages.
local_base=lapwing-base:bookworm
official=python:3.11-slim-bookworm
if [ -z "${BASE:-}" ]; then
    BASE=$official
    if ! docker image inspect "$official" > /dev/null 2>&1 &&
        ! timeout 300 docker pull --quiet "$official" > /dev/null 2>&1; then
        BASE=$local_base
        docker image inspect "$local_base" > /dev/null 2>&1 || {
            echo "build: $official cannot be pulled; building $local_base from Debian's packages"
            deploy/base-image.sh "$local_base"
        }
    fi
fi
export BASE

# The last build's kernels: what has not changed since is not compiled again.
mkdir -p build
rm -rf build/kernels
if last=$(docker create "${IMAGE:-lapwing}" 2> /dev/null); then
    docker cp "$last:/var/cache/lapwing" build/kernels > /dev/null
    docker rm "$last" > /dev/null
fi

# With the host's pip the wheels are fetched by its settings; without, pip in the build asks the index itself.
WHEELS=
if ${PYTHON:-python3} -m pip --version > /dev/null 2>&1; then
    WHEELS=${IMAGE:-lapwing}-wheels
    deploy/wheels.sh "$BASE" "$WHEELS"
fi
export WHEELS

$COMPOSE build mission tests > build/docker-build.log 2>&1 || { tail -30 build/docker-build.log >&2; exit 1; }
docker image ls --format '{{.Repository}}:{{.Tag}} {{.Size}}' | grep "^${IMAGE:-lapwing}\(-tests\)\?:latest " | sort

#!/bin/sh
# Builds the images lapwing and lapwing-tests (`make docker-build`), also without access to a registry.
#
#   [BASE=IMAGE] [IMAGE=NAME] [PYTHON=python3] deploy/build.sh
set -eu
cd "$(dirname "$0")/.."
. deploy/compose.sh

# Base image: $BASE, otherwise the official one, otherwise one built here from Debian's packages.
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

# Kernels of the last build: unchanged ones are not compiled again.
mkdir -p build
rm -rf build/kernels
if last=$(docker create "${IMAGE:-lapwing}" 2> /dev/null); then
    docker cp "$last:/var/cache/lapwing" build/kernels > /dev/null
    docker rm "$last" > /dev/null
fi

# With pip on the host, the wheels are downloaded with its settings; otherwise pip in the build uses the index.
WHEELS=
if ${PYTHON:-python3} -m pip --version > /dev/null 2>&1; then
    WHEELS=${IMAGE:-lapwing}-wheels
    deploy/wheels.sh "$BASE" "$WHEELS"
fi
export WHEELS

$COMPOSE build mission tests > build/docker-build.log 2>&1 || { tail -30 build/docker-build.log >&2; exit 1; }
docker image ls --format '{{.Repository}}:{{.Tag}} {{.Size}}' | grep "^${IMAGE:-lapwing}\(-tests\)\?:latest " | sort

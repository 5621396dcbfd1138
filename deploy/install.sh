#!/bin/sh
# Build step of the Dockerfile: installs the pinned packages to /opt/lapwing, those of the tests to /opt/lapwing-tests,
# and the build backend to /opt/backend, which is in no image.
set -eu
cd /build

# With downloaded wheels (deploy/wheels.sh) no index is used.
if ls ./*.whl > /dev/null 2>&1; then export PIP_NO_INDEX=1 PIP_FIND_LINKS=/build; fi

# The environment has no pip: that of the base image installs the packages, and nothing is installed at run time.
python3 -m venv --without-pip /opt/lapwing
for lock in requirements*.lock; do
    case $lock in
        *-tests.lock) pip --python /opt/lapwing/bin/python install --no-deps --target /opt/lapwing-tests -r "$lock" ;;
        *) pip --python /opt/lapwing/bin/python install --no-deps -r "$lock" ;;
    esac
done
mkdir /opt/backend
(cd /opt/lapwing/lib/python3.*/site-packages && mv setuptools* _distutils_hack distutils-precedence.pth /opt/backend/)
python3 slim.py /opt/lapwing/lib/python3.*/site-packages /opt/lapwing-tests

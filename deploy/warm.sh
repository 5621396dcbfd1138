#!/bin/sh
# Build step of the Dockerfile: installs the package, compiles the kernels, builds matplotlib's font list.
set -eu
cd /app

pip --python /opt/lapwing/bin/python install --no-deps --no-build-isolation --no-index --no-cache-dir --editable .
rm -rf build
/opt/lapwing/bin/lapwing warm
python -c 'import matplotlib.font_manager'

# Whoever the services run as may add kernels that no build foresaw, and records here.
mkdir -p recordings
chmod 777 recordings
chmod -R a+rwX "$LAPWING_CACHE"

#!/bin/sh
# Build step of the Dockerfile: all that images have besides packages, to /image: sources, command, kernels.
set -eu

mkdir -p /image/app/recordings /image/opt/lapwing /image/var/cache "$LAPWING_CACHE"
for name in pyproject.toml README.md scenes messages dynamics cosim services studies lapwing; do
    cp -rp "/build/$name" /image/app/
done
chmod 777 /image/app/recordings
cp -rp /image/app/. /app/

pip --python /opt/lapwing/bin/python install --prefix /image/opt/lapwing \
    --no-deps --no-build-isolation --no-index --no-cache-dir --no-warn-script-location --editable /app
cp /build/deploy/entrypoint.sh /image/opt/lapwing/bin/

cp -rp /image/opt/lapwing/. /opt/lapwing/
if [ -d /build/build/kernels ]; then cp -rp /build/build/kernels/. "$LAPWING_CACHE"; fi
python /build/deploy/warm.py
cp -rp "$LAPWING_CACHE" /image/var/cache/

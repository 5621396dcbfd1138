#!/bin/sh
# Build step of the Dockerfile: writes sources, command and kernels, but no packages, to /image.
set -eu

for name in pyproject.toml README.md LICENSE messages services lapwing; do
    cp -rp "/build/$name" /image/app/
done
mkdir -p /image/app/recordings "/image$LAPWING_CACHE"
chmod 777 /image/app/recordings
cp /build/deploy/entrypoint.sh /build/deploy/keys.sh /image/opt/lapwing/bin/
if [ -d /build/build/kernels ]; then cp -rp /build/build/kernels/. "/image$LAPWING_CACHE/"; fi

# Links at the paths that the files have in the images.
ln -sf /image/app/* /app/
ln -s "/image$LAPWING_CACHE" "$LAPWING_CACHE"
python /build/deploy/warm.py

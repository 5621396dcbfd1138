#!/bin/sh
# Runs a command of the image as the user that shall own its output files.
#
# The user of the image is not root. docker-compose.yml starts a service that writes to the host as root; here it becomes
# the owner of the mounted recordings folder, before any code of the project runs. Logs and reports therefore belong to
# that user, with any UID and without further settings, also under a rootless engine. Root without capabilities
# (USER_ID=0 in deploy/hosts) stays root, and has no capabilities to drop.
set -eu

if [ "$(id -u)" -eq 0 ] && ! grep -q "^CapEff:[[:space:]]*0*$" /proc/self/status; then
    owner=$(stat -c %u recordings)
    group=$(stat -c %g recordings)
    exec setpriv --reuid "$owner" --regid "$group" --clear-groups --inh-caps=-all --bounding-set=-all "$@"
fi
exec "$@"

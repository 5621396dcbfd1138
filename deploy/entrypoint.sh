#!/bin/sh
# Runs a command of the image as the user who shall own what it writes.
#
# The image's own user is not root. A service that writes to the host is started as root by docker-compose.yml, and
# becomes here whoever owns the mounted recordings folder, before anything of the project runs. So logs and reports
# belong to the user with any UID, without a file or a variable that tells it, and under a rootless engine too.
# Root without any capability (USER_ID=0 of deploy/hosts) stays who it is, and has none to give up.
set -eu

if [ "$(id -u)" -eq 0 ] && ! grep -q "^CapEff:[[:space:]]*0*$" /proc/self/status; then
    owner=$(stat -c %u recordings)
    group=$(stat -c %g recordings)
    exec setpriv --reuid "$owner" --regid "$group" --clear-groups --inh-caps=-all --bounding-set=-all "$@"
fi
exec "$@"

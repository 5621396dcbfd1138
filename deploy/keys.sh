#!/bin/sh
# Creates a certificate for each participant of a flight in containers: the service `keys` of docker-compose.yml.
#
#   keys.sh [NAME...]    containers that run as the owner of recordings/ (deploy/entrypoint.sh), not as the image's user
#
# keys/NAME is a volume that only the container NAME mounts. Existing certificates are kept if all have the same authority
# and are valid for another week; otherwise all are created again. The authority's private key is never stored.
# Needs only the capability CHOWN: the folders belong to root, a key belongs to its user.
set -eu

WEEK=604800 # [s]

are_valid() {
    authority=
    for own in keys/*; do
        [ -s "$own/authority.pem" ] && [ -s "$own/key.pem" ] && [ -s "$own/zenoh.json5" ] || return 1
        cmp -s "$own/authority.pem" "${authority:=$own/authority.pem}" || return 1
        openssl verify -CAfile "$authority" "$own/certificate.pem" > /dev/null 2>&1 || return 1
        openssl x509 -in "$own/certificate.pem" -noout -checkend $WEEK > /dev/null || return 1
    done
}

if ! are_valid; then
    new=$(mktemp -d)
    trap 'rm -rf "$new"' EXIT
    lapwing certificates "$new/keys" > /dev/null
    rm -f keys/*/authority.pem # if this is interrupted, the remaining files are invalid
    for own in keys/*; do
        for file in key.pem zenoh.json5 certificate.pem authority.pem; do
            rm -f "$own/$file"
            cp -p "$new/$own/$file" "$own/"
        done
    done
fi

for own in keys/*; do
    user=lapwing
    for name in "$@"; do
        if [ "$own" = "keys/$name" ]; then user=$(stat -c %u:%g recordings); fi
    done
    chown "$user" "$own/key.pem" "$own/zenoh.json5"
    until=$(openssl x509 -in "$own/certificate.pem" -noout -enddate)
    names="${names:+$names, }${own#keys/}"
done
echo "certificates of $names, until ${until#*=}"

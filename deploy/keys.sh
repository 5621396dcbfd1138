#!/bin/sh
# A certificate for each participant of a flight in containers: the service `keys` of docker-compose.yml.
#
#   keys.sh [NAME...]    of whom the owner of recordings/ is the user (deploy/entrypoint.sh), not the image's own user
#
# keys/NAME is a volume that no other container sees but that of NAME. What is there stays while all of it is of one
# authority and good for another week; else everybody's is made anew. The authority's own key is never written there.
# Needs no capability but CHOWN: the folders are root's, a key is of who uses it.
set -eu

WEEK=604800 # [s]

sound() {
    authority=
    for own in keys/*; do
        [ -s "$own/authority.pem" ] && [ -s "$own/key.pem" ] && [ -s "$own/zenoh.json5" ] || return 1
        cmp -s "$own/authority.pem" "${authority:=$own/authority.pem}" || return 1
        openssl verify -CAfile "$authority" "$own/certificate.pem" > /dev/null 2>&1 || return 1
        openssl x509 -in "$own/certificate.pem" -noout -checkend $WEEK > /dev/null || return 1
    done
}

if ! sound; then
    made=$(mktemp -d)
    trap 'rm -rf "$made"' EXIT
    lapwing certificates "$made/keys" > /dev/null
    rm -f keys/*/authority.pem # whatever ends this early: what is left is not sound
    for own in keys/*; do
        for file in key.pem zenoh.json5 certificate.pem authority.pem; do
            rm -f "$own/$file"
            cp -p "$made/$own/$file" "$own/"
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
    everybody="${everybody:+$everybody, }${own#keys/}"
done
echo "certificates of $everybody, until ${until#*=}"

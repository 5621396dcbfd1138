#!/bin/sh
# Builds the local image lapwing-base:bookworm, similar to a slim official Python image, from Debian's packages.
#
#   deploy/base-image.sh [TAG]
#
# For hosts that cannot pull images. It needs a Debian-like host (apt-get, dpkg-deb) whose apt sources offer Debian
# bookworm, and the Docker engine; it needs no root and changes nothing on the host. apt uses a separate state with the
# host's sources, proxies and keys, and none of these enter the image.
set -eu

TAG=${1:-lapwing-base:bookworm}
RELEASE=bookworm
KEYRING=/usr/share/keyrings/debian-archive-keyring.gpg
PACKAGES="usr-is-merged python3 python3-venv python3-pip ca-certificates openssl passwd"

fail() { echo "base-image: $*" >&2; exit 1; }
for tool in apt-get dpkg-deb docker tar; do command -v "$tool" >/dev/null || fail "needs $tool"; done

work=$(mktemp -d)
container=
cleanup() {
    [ -z "$container" ] || docker rm --force "$container" >/dev/null 2>&1 || true
    docker image rm "$TAG-unpacked" >/dev/null 2>&1 || true
    rm -rf "$work"
}
trap cleanup EXIT
trap 'exit 1' INT TERM

mkdir -p "$work/state/lists/partial" "$work/cache/archives/partial" "$work/tree" "$work/debs"
: > "$work/status"

# Only the entries for this release.
apt-get indextargets --format "deb [signed-by=$KEYRING] \$(REPO_URI) \$(RELEASE) \$(COMPONENT)" \
    'Created-By: Packages' 'Component: main' |
    grep -E " $RELEASE(-updates|-security)? main\$" | sort -u > "$work/sources.list" ||
    fail "the host's apt sources offer no Debian $RELEASE"

# A separate state, without the host's hooks.
cat > "$work/apt.conf" <<CONF
Dir::State "$work/state";
Dir::State::status "$work/status";
Dir::Cache "$work/cache";
Dir::Etc::SourceList "$work/sources.list";
Dir::Etc::SourceParts "/dev/null";
APT::Sandbox::User "";
APT::Install-Recommends "false";
#clear APT::Update::Post-Invoke;
#clear APT::Update::Post-Invoke-Success;
CONF
private_apt() { apt-get --quiet=2 --config-file="$work/apt.conf" "$@"; }
private_apt update || fail "apt-get update failed"
# shellcheck disable=SC2086  # a list of packages
private_apt install --yes --download-only '?essential' $PACKAGES > /dev/null ||
    fail "apt-get could not fetch the packages"
cp "$work"/cache/archives/*.deb "$work/debs/"

# A minimal tree that can run dpkg: merged /usr, every package unpacked over it, nothing configured.
mkdir -p "$work/tree/usr/bin" "$work/tree/usr/sbin" "$work/tree/usr/lib" "$work/tree/usr/lib64"
for name in bin sbin lib lib64; do ln -s "usr/$name" "$work/tree/$name"; done
mkdir -p "$work/tree/etc/dpkg/dpkg.cfg.d" "$work/tree/var/lib/dpkg/info" "$work/tree/var/lib/dpkg/updates"
: > "$work/tree/var/lib/dpkg/status"
cat > "$work/tree/etc/dpkg/dpkg.cfg.d/slim" <<'SLIM'
path-exclude /usr/share/doc/*
path-include /usr/share/doc/*/copyright
path-exclude /usr/share/man/*
path-exclude /usr/share/info/*
path-exclude /usr/share/locale/*
path-exclude /usr/share/lintian/*
SLIM
for deb in "$work"/debs/*.deb; do
    dpkg-deb --fsys-tarfile "$deb" | tar -x -C "$work/tree" --keep-directory-symlink --no-same-owner \
        --exclude='./usr/share/doc/*' --exclude='./usr/share/man/*' --exclude='./usr/share/info/*' \
        --exclude='./usr/share/locale/*' --exclude='./usr/share/lintian/*'
done
tar -c -C "$work/tree" --numeric-owner --owner=0 --group=0 . | docker import - "$TAG-unpacked" >/dev/null

# dpkg then installs everything properly (owners, modes, scripts) in a container without network.
container=$(docker create --network none --env DEBIAN_FRONTEND=noninteractive --volume "$work/debs:/debs:ro" \
    "$TAG-unpacked" /bin/sh -euc '
    export PATH=/usr/sbin:/usr/bin
    printf "root:x:0:0:root:/root:/bin/sh\n" > /etc/passwd
    printf "root:x:0:\nmail:x:8:\nutmp:x:43:\nshadow:x:42:\nstaff:x:50:\n" > /etc/group
    dpkg --force-depends --install /debs/base-passwd_*.deb /debs/base-files_*.deb
    dpkg --force-depends --install /debs/*.deb
    dpkg --configure --pending
    dpkg --audit
    ln -sf /usr/bin/python3 /usr/local/bin/python
    find /var/cache /var/log -type f -delete
    find / -xdev -path "*/dist-packages/*" -name __pycache__ -prune -exec rm -rf {} +
    rm -rf /usr/lib/python3/dist-packages/*/tests /usr/lib/python3.11/test /usr/lib/python3.11/idlelib
    rm -f /var/lib/dpkg/*-old /etc/*-
')
docker start --attach "$container" > "$work/log" 2>&1 || { tail -20 "$work/log" >&2; fail "dpkg failed"; }
docker export "$container" | docker import \
    --change 'ENV PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin' --change 'ENV LANG=C.UTF-8' \
    --change 'CMD ["python3"]' - "$TAG" >/dev/null
docker image ls "$TAG"

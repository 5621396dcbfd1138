#!/bin/sh
# Tests the images on a running engine (`make docker-test`): the mission flies in containers with the local digest.
#
#   [LAPWING=.venv/bin/lapwing] [BASE=IMAGE] deploy/docker_test.sh
#
# Uses a separate folder and compose project and removes both; the images stay, so a second run is fast.
set -eu
cd "$(dirname "$0")/.."
. deploy/compose.sh

skip() { echo "docker-test: skipped: $*"; exit 0; }
docker info > /dev/null 2>&1 || skip "no Docker engine answers"
$COMPOSE version > /dev/null 2>&1 || skip "no docker compose"

ROOT=$PWD
LAPWING=$(realpath --no-symlinks "${LAPWING:-.venv/bin/lapwing}")
SCENE=lapwing/scenes/delivery_mission.toml
IMAGE=${IMAGE:-lapwing}
LIMIT=710000000 # [bytes] of an image, 4 MB of which are stored generated functions (experiments.md, compile time)
TIMEOUT=300     # [s] for the mission to start, fly and end
WITHIN=${WITHIN:-10} # [s] limit until all containers end after one is killed
BUSY=${BUSY:-60}     # [s] this limit on a machine with busy processors
PORT=${PORT:-0}   # 0: any free port
FOXGLOVE_PORT=${FOXGLOVE_PORT:-0}
export SCENE IMAGE PORT FOXGLOVE_PORT

deploy/build.sh

work=$(mktemp -d)
COMPOSE_PROJECT_NAME="lapwing-test-$$"
export COMPOSE_PROJECT_NAME
cleanup() {
    cd "$work"
    $COMPOSE down --timeout 2 --volumes --remove-orphans > /dev/null 2>&1 || true
    cd /
    rm -rf "$work"
}
trap cleanup EXIT
trap 'exit 1' INT TERM

fail() {
    echo "docker-test: FAILED: $*" >&2
    tail -40 "$work/compose.log" >&2 2> /dev/null || true
    exit 1
}
passed() { echo "docker-test: $*"; }

containers() { docker ps --quiet --filter "label=com.docker.compose.project=$COMPOSE_PROJECT_NAME" "$@"; }
container() { # SERVICE [OPTION]
    service=$1
    shift
    containers --filter "label=com.docker.compose.service=$service" "$@"
}
remove_containers() {
    # shellcheck disable=SC2046
    docker rm --force $(containers --all) > /dev/null
}
until_it_flies() { # NAME: wait for the first line of a flight in compose.log
    waited=0
    until grep -q "t = " compose.log; do
        sleep 1
        waited=$((waited + 1))
        [ $waited -lt $TIMEOUT ] || fail "$1 has not started"
    done
}

for image in "$IMAGE" "$IMAGE-tests"; do
    size=$(docker image inspect --format '{{.Size}}' "$image")
    [ "$size" -lt $LIMIT ] || fail "$image has $size bytes, expected at most $LIMIT"
    [ "$(docker run --rm --network none "$image" id -u)" -ne 0 ] || fail "$image runs as root"
    passed "$image: $((size / 1000000)) MB, not root"
done

docker run --rm --network none "$IMAGE-tests" python -m pytest --version > /dev/null 2>&1 || fail "the tests do not start"

# A user's folder; if possible, its owner is neither root nor a user of the image.
mkdir "$work/lapwing"
cp docker-compose.yml "$work/"
cp -r lapwing/scenes "$work/lapwing/"
mkdir "$work/recordings"
if [ "$(id -u)" -eq 0 ]; then chown 4321:4321 "$work/recordings"; fi
owner=$(stat -c %u:%g "$work/recordings")
cd "$work"

begun=$(date +%s)
# shellcheck disable=SC2086  # may be two words
timeout $TIMEOUT $COMPOSE up --no-build mission > compose.log 2>&1 < /dev/null ||
    fail "compose up mission ended with exit code $?"
for container in $(containers --all); do
    name=$(docker inspect --format '{{index .Config.Labels "com.docker.compose.service"}}' "$container")
    code=$(timeout 30 docker wait "$container") || fail "$name did not end"
    [ "$code" -eq 0 ] || { docker logs --tail 20 "$container" >&2; fail "$name ended with exit code $code"; }
    names="${names:+$names }$name"
done
passed "all ended with exit code 0 after $(($(date +%s) - begun)) s: $names"

field() { python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))[sys.argv[2]])' "$1" "$2"; }
[ -s recordings/mission.json ] || fail "no recordings/mission.json"
[ "$(field recordings/mission.json landed)" = True ] || fail "the drone has not landed"
for file in recordings/mission.json "$(field recordings/mission.json log)" "$(field recordings/mission.json report)"; do
    [ -s "$file" ] || fail "$file is missing"
    [ "$(stat -c %u:%g "$file")" = "$owner" ] || fail "$file belongs to $(stat -c %u:%g "$file"), expected $owner"
done
passed "landed; log and report belong to $owner"

"$LAPWING" run $SCENE --mode single-process --log local.mcap --json local.json > local.log 2>&1 ||
    { tail -5 local.log >&2; fail "the local run failed"; }
there=$(field recordings/mission.json digest)
here=$(field local.json digest)
[ "$there" = "$here" ] || fail "digest $there in containers, $here locally"
passed "digest equal to the local run's: $here"

# A campaign on a scheduler and two workers has the table of a local one.
# shellcheck disable=SC2086
RUNS=4 timeout $TIMEOUT $COMPOSE --profile cluster up --no-build --exit-code-from campaign scheduler worker campaign \
    > compose.log 2>&1 < /dev/null ||
    fail "the campaign ended with exit code $?"
[ "$(stat -c %u:%g recordings/campaign/runs.csv)" = "$owner" ] || fail "the campaign's table does not belong to $owner"
"$LAPWING" campaign $SCENE --runs 4 --workers 1 --csv --out campaign > local.log 2>&1 ||
    { tail -5 local.log >&2; fail "the local campaign failed"; }
cmp recordings/campaign/runs.csv campaign/runs.csv || fail "the campaign has a table that differs from the local one"
passed "a campaign on two workers has the local table"

# A flight live in Foxglove: a client on this host receives it to its end. No other container in the network, with or
# without the certificate of a viewer, can read more than permitted or change the flight; a viewer on this host can read.
network="${COMPOSE_PROJECT_NAME}_default"
authority() { $COMPOSE ps --all --quiet keys | xargs -I{} docker cp {}:/app/keys/plant/authority.pem - | sha256sum; }
first=$(authority)
remove_containers
SPEED=0.5 LOG=recordings/shown.mcap JSON=recordings/shown.json \
    timeout $TIMEOUT $COMPOSE --profile view up --no-build > compose.log 2>&1 < /dev/null &
up=$!
waited=0
until address=$(docker port "$(container foxglove)" 8765 2> /dev/null) && grep -q "t = " compose.log; do
    sleep 1
    waited=$((waited + 1))
    [ $waited -lt $TIMEOUT ] || fail "the mission to be shown has not started"
done
[ "${address%:*}" = 127.0.0.1 ] || fail "foxglove is published at $address"
(cd "$ROOT" && exec "$(dirname "$LAPWING")/python" - "${address##*:}") > shown.txt 2>&1 << 'CLIENT' &
import sys, time
from tests.services.foxglove.client import Client

client, shown, tries = None, 0, 60
while client is None:
    try:
        client = Client(int(sys.argv[1]))
    except (ConnectionError, EOFError):  # the engine listens before the container
        tries -= 1
        assert tries, "foxglove does not listen"
        time.sleep(1.0)
client.subscribe("/drone1/ground_truth")
while (message := client.next()) is not None:
    shown += isinstance(message, bytes) and message[0] == 1
assert shown > 100, f"{shown} messages"
print(shown)
CLIENT
client=$!
[ "$(authority)" = "$first" ] || fail "a second start created other certificates"
ends=
for name in mission plant sensors autopilot trajectory recorder router foxglove; do
    ends="${ends:+$ends }tls/$name:7447"
    seen=$(docker exec "$(container $name)" ls keys)
    [ "$seen" = "$name" ] || fail "$name sees the certificates of $seen"
done
intruder() { # ARGUMENT... of docker
    timeout 60 docker "$@" < "$ROOT/deploy/intruder.py" >> intruder.txt 2>&1 || fail "$(tail -1 intruder.txt)"
}
expect() { # RESULT ENDPOINT...: check the line of the intruder for each endpoint
    what=$1
    shift
    for end in "$@"; do
        name=${end#*/}
        [ "$what" = refused ] || end="$end of ${name%:*}" # the name in its certificate
        grep -q "^$end: $what\$" intruder.txt || { cat intruder.txt >&2; fail "$end: expected $what"; }
    done
    : > intruder.txt
}
: > intruder.txt
# shellcheck disable=SC2086  # lists
{
    intruder run --rm -i --network "$network" "$IMAGE" python - nobody $ends
    expect refused $ends
    plain=$(echo "$ends" | sed s#tls/#tcp/#g)
    intruder run --rm -i --network "$network" "$IMAGE" python - nobody $plain
    expect refused $plain
    intruder run --rm -i --network "$network" --volume "${COMPOSE_PROJECT_NAME}_keys-viewer:/app/keys/viewer:ro" "$IMAGE" \
        python - viewer $ends
    expect topics $ends
    intruder exec -i "$(container foxglove)" python - foxglove $ends
    expect "topics and lock step" $ends
}
mkdir keys
docker cp "$($COMPOSE ps --all --quiet keys)":/app/keys/viewer keys/ > /dev/null
address=$(docker port "$(container router)" 7448)
"$(dirname "$LAPWING")/python" - "$address" > viewer.txt 2>&1 << 'VIEWER' || fail "a viewer on this host: $(tail -1 viewer.txt)"
import queue, sys
import zenoh

configuration = zenoh.Config.from_file("keys/viewer/zenoh.json5")
configuration.insert_json5("connect/endpoints", f'["tls/{sys.argv[1]}"]')
arrived = queue.Queue()
with zenoh.open(configuration) as session:
    session.declare_subscriber("lapwing/drone1/ground_truth", arrived.put)
    arrived.get(timeout=10.0)
VIEWER
[ -n "$(container plant)" ] || fail "the flight ended before all intruders had tried"
passed "refused without certificate, only topics with the viewer's certificate, at $ends"
wait $client || fail "$(tail -1 shown.txt)"
wait $up || fail "compose --profile view up ended with exit code $?"
for container in $(containers --all); do
    code=$(docker inspect --format '{{.State.ExitCode}}' "$container")
    [ "$code" -eq 0 ] || { docker logs --tail 20 "$container" >&2; fail "a container of the view ended with exit code $code"; }
    if docker logs "$container" 2>&1 | grep "rejected: [0-9]* messages from outside"; then fail "forged messages reached a participant"; fi
done
[ "$(field recordings/shown.json digest)" = "$here" ] || fail "with intruders the digest differs"
passed "intruders could not command: same digest; a Foxglove client received $(cat shown.txt) states, to the end"

# A container killed in flight ends the run, which names it; containers cannot write to their image, and are healthy.
remove_containers
: > compose.log # cleared now, so that lines of an earlier flight are not found below
# shellcheck disable=SC2086
SPEED=1 LOG=recordings/killed.mcap JSON=recordings/killed.json $COMPOSE up --no-build mission > compose.log 2>&1 < /dev/null &
up=$!
until_it_flies "the mission to be killed"
victim=$(container sensors)
[ -n "$victim" ] || fail "no container of sensors runs"
if docker exec "$victim" touch /app/here 2> /dev/null; then fail "a container writes to its image"; fi
until [ "$(docker inspect --format '{{.State.Health.Status}}' "$victim")" = healthy ]; do
    sleep 1
    waited=$((waited + 1))
    [ $waited -lt $((2 * TIMEOUT)) ] || fail "sensors is not healthy"
done
processors() { awk '/^cpu /{ print $2 + $3 + $4 + $6 + $7 + $8 + $9, $5; exit }' /proc/stat; } # ticks: used, idle
begun=$(date +%s.%N)
before=$(processors)
docker kill "$victim" > /dev/null
wait $up || true
seconds=$(echo "$begun $(date +%s.%N)" | awk '{ printf "%.1f", $2 - $1 }')
idle=$(echo "$before $(processors)" | awk '{ used = $3 - $1; idle = $4 - $2; printf "%d", 100 * idle / (used + idle) }')
grep -q "lapwing: sensors: left the run at t = " compose.log || fail "no message says that sensors has left"
limit=$WITHIN
if [ "$idle" -lt 20 ]; then limit=$BUSY; fi
[ "${seconds%.*}" -lt "$limit" ] || fail "ended $seconds s after sensors was killed, $idle % idle: expected at most $limit s"
passed "read-only, healthy; sensors killed: ended by name after $seconds s, $idle % idle"

# A missing certificate leads to new certificates for all. Without certificates the intruder does end the flight, which
# shows that certificates stopped it above.
docker run --rm --user 0 --volume "${COMPOSE_PROJECT_NAME}_keys-plant:/own" "$IMAGE-tests" rm /own/certificate.pem
$COMPOSE up --no-build keys > keys.log 2>&1 < /dev/null || fail "$(tail -3 keys.log)"
[ "$(authority)" != "$first" ] || fail "a certificate was missing, but no new ones were created"
remove_containers
: > compose.log
SCHEME=tcp LINKS=--insecure SPEED=1 LOG=recordings/open.mcap JSON=recordings/open.json \
    timeout $TIMEOUT $COMPOSE up --no-build mission > compose.log 2>&1 < /dev/null &
up=$!
until_it_flies "the mission without certificates"
intruder run --rm -i --network "$network" "$IMAGE" python - nobody tcp/mission:7447
wait $up || true
[ "$(docker inspect --format '{{.State.ExitCode}}' "$(container mission --all)")" -ne 0 ] || # the first of its messages to arrive ends the run
    fail "the intruder had no effect on an open network: $(cat intruder.txt)"
passed "a missing certificate is replaced; without certificates an intruder ended the flight"

# Replay of the log on the bus without subscribers: it must play to its end and report it.
LOG=recordings/mission.mcap
export LOG
# shellcheck disable=SC2086
timeout 120 $COMPOSE run --rm -T replay lapwing replay "$LOG" --speed max > replay.log 2>&1 < /dev/null ||
    { tail -5 replay.log >&2; fail "docker compose run replay ended with exit code $?"; }
grep -q "messages published" replay.log || fail "the replay did not report its messages"
passed "replay: $(tail -1 replay.log)"

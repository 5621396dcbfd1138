# shellcheck shell=sh disable=SC2034
# Sourced: $COMPOSE is the compose command, whichever of Docker's two is there.
if docker compose version > /dev/null 2>&1; then
    COMPOSE="docker compose"
else
    COMPOSE=docker-compose
fi

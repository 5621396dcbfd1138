# shellcheck shell=sh disable=SC2034
# To be sourced: sets $COMPOSE to the available compose command.
if docker compose version > /dev/null 2>&1; then
    COMPOSE="docker compose"
else
    COMPOSE=docker-compose
fi

"""FMUs as services: each runs in a separate process and steps in lock step."""

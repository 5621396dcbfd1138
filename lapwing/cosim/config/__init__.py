"""Run configuration: a scene resolved to numbers, its serialisation and provenance."""

"""The co-simulation engine: scenes, lock step, executors, bus, log. It knows no service by name."""

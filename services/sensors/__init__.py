"""The sensor service: readings of instruments from the true state. Each module with `PRESETS` is a sensor."""

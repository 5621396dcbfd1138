"""Sensors: from the true motion to what instruments say. One file each; a file with `PRESETS` is a sensor."""

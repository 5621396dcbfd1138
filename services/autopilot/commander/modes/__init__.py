"""The flight modes, a module each: `NAME`, and a class `Mode` that moves the setpoint."""

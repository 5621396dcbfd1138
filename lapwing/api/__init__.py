"""Public interface: functions, flights and simulators that `import lapwing` offers."""

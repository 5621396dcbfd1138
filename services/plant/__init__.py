"""The dynamics plant: owns time, turns motor voltages into motion."""

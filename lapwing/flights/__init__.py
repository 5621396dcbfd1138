"""Flights: reading of logs, events, metrics, outcome, and the import of other logs."""

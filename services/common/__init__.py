"""Definitions that several services share: scene tables, ports, parameters, flight plans."""

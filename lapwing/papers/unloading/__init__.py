"""Self-unloading crate of the delivery quadcopter (Machines 2023, 11, 464)."""

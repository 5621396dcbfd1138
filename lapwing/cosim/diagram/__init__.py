"""Block diagrams: compiled blocks, ports, schedule, topic encoders."""

"""What the simulator is used to find out."""

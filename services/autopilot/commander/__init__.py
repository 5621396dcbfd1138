"""What the vehicle is to do now: flight modes, missions, failsafes, and the operator's commands."""

"""Random landings against an independent reference in which every transition of every foot is a located event."""

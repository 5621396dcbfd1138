"""The plant service: clock owner and vehicle dynamics."""

"""What flies: equations of motion of each vehicle, and what an airframe's file says."""

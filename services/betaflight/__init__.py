"""Adapter of Betaflight SITL: UDP packets, MSP, and a pilot that flies the trajectory by RC channels."""

"""Fly the vehicle through MAVSDK: arm, take off, fly 10 m north, return, land.

lapwing run groundstation --mavlink udpout:127.0.0.1:14540    # in another terminal
pip install "mavsdk>=3.17,<4"
python mavsdk_flight.py
"""

import asyncio
import sys
from collections.abc import AsyncIterator, Callable
from typing import Any

from mavsdk import System

NORTH = 10.0 / 111_320.0  # [deg] of latitude in 10 m
HEIGHT = 5.0  # [m]


async def until(stream: AsyncIterator[Any], condition: Callable[[Any], bool]) -> Any:
    """Return the first value of a stream that meets a condition."""
    async for value in stream:
        if condition(value):
            return value


async def fly(address: str) -> None:
    """Fly from take-off to landing over the link at `address`."""
    drone = System()
    await drone.connect(system_address=address)
    await until(drone.telemetry.health_all_ok(), bool)
    await drone.action.set_takeoff_altitude(HEIGHT)
    await drone.action.arm()
    await drone.action.takeoff()
    start = await until(drone.telemetry.position(), lambda p: p.relative_altitude_m > HEIGHT - 0.3)
    print(f"at {start.relative_altitude_m:.1f} m")
    north = start.latitude_deg + NORTH
    await drone.action.goto_location(north, start.longitude_deg, start.absolute_altitude_m, 0.0)
    await until(drone.telemetry.position(), lambda p: abs(p.latitude_deg - north) < 0.05 * NORTH)
    print("10 m north")
    await drone.action.return_to_launch()
    await until(drone.telemetry.in_air(), lambda in_air: not in_air)
    await until(drone.telemetry.armed(), lambda armed: not armed)
    print("landed and disarmed")


if __name__ == "__main__":
    asyncio.run(fly(sys.argv[1] if len(sys.argv) > 1 else "udpin://127.0.0.1:14540"))

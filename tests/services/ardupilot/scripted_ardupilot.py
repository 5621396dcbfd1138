"""Scripted replacement of ArduPilot for complete runs: climbs to 2 m, descends and stops the motors.

Started as `python scripted_ardupilot.py --instance N ...`. With `--die` it exits in flight.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3]))

from tests.services.ardupilot.peer import ArduPilotPeer

HOVER, HEIGHT = 0.62, 2.0  # duty in hover; [m]


def main():
    """Run the flight."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--instance", type=int)
    parser.add_argument("--die", action="store_true")
    options, _ = parser.parse_known_args()
    peer, duty, ground = ArduPilotPeer(9002 + 10 * options.instance), 0.0, None
    while True:
        state = peer.exchange((1000 + round(1000 * duty),) * 4 + (0,) * 12)
        ground = -state["position"][2] if ground is None else ground
        height, rate, elapsed = -state["position"][2] - ground, -state["velocity"][2], state["timestamp"][0] - 1.0
        target = HEIGHT if elapsed < 5.0 else HEIGHT - 0.5 * (elapsed - 5.0)
        duty = min(max(HOVER + 0.1 * (target - height) - 0.08 * rate, 0.0), 1.0) if 0.0 < elapsed < 12.0 else 0.0
        if options.die and elapsed > 3.0:
            sys.exit("crashed on purpose")


if __name__ == "__main__":
    main()

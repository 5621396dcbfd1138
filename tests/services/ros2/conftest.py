"""zenoh-ros2-sdk lies in a folder of its own (Makefile), which is looked through last."""

import sys
from pathlib import Path

sys.path.append(str(Path(sys.prefix, "ros2-sdk")))

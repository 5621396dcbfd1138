"""Environments of Gymnasium: hover, track a path, land, race through gates; many vehicles at once, or one.

```python
import gymnasium

vector_mode = {"num_envs": 1024, "vectorization_mode": "vector_entry_point"}
environments = gymnasium.make_vec("lapwing.gym:lapwing/Hover-v0", **vector_mode)
one = gymnasium.make("lapwing.gym:lapwing/Race-v0")
```

Gymnasium imports the module before the colon, which registers the environments. Without it, import this module first:
Gymnasium has no plug-ins since version 1.0.

Needs `pip install lapwing[gym]`.
"""

from lapwing.gym.tasks import TASKS
from lapwing.gym.vector_env import DroneEnv, DroneVectorEnv

__all__ = ["TASKS", "DroneEnv", "DroneVectorEnv"]

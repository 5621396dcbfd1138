"""Environments of Gymnasium: hover, track a path, land, race through gates; many vehicles at once, or one.

```python
import gymnasium
import lapwing.gym  # registers them

environments = gymnasium.make_vec("lapwing/Hover-v0", num_envs=1024, vectorization_mode="vector_entry_point")
one = gymnasium.make("lapwing/Race-v0")
```

Needs `pip install lapwing[gym]`.
"""

from lapwing.gym.tasks import TASKS
from lapwing.gym.vector_env import DroneEnv, DroneVectorEnv

__all__ = ["TASKS", "DroneEnv", "DroneVectorEnv"]

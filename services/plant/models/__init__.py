"""What a plant can be: one file for each value of `vehicle.model`, found by scanning this folder.

A model file has `check(scene)`, which refuses a scene that lacks what the model needs, and `create(scene)`, which gives
the lock-step service with `finished`. A table of its own is a `Section` in the same file.
"""

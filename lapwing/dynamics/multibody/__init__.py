"""Rigid bodies in redundant coordinates: joints and drives as constraints, solved on index 1 (theory.md, chapter 8).

The general path, any mechanism, arrays: `system` (what there is) -> `placement` (coordinates to poses) -> `constraints`
(rows) -> `augmented` (accelerations and multipliers) -> `stabilisation`. The fast path, one core and four leaves:
`arrow`, then `five_bodies` and `hold` (redundant states) or `delivery_drone` (least states, for the plant). The tests
have a second way to the accelerations, reactions, consistent starts, and runs of any mechanism.
"""

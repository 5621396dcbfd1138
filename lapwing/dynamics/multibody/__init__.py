"""Rigid bodies in redundant coordinates: joints and drives as constraints, solved on index 1 (theory, chapter 8).

General path, any mechanism in arrays: `system` (bodies and joints) -> `body_kinematics` (coordinates to poses) ->
`constraints` (rows) -> `augmented` (accelerations and multipliers) -> `stabilisation`. Fast path, one core and four
leaves: `arrowhead_solver`, then `five_bodies` and `five_body_stabilisation` (redundant states) or `delivery_drone`
(minimal states, for the plant). The tests compute accelerations, reactions, consistent initial states and runs of any
mechanism independently.
"""

"""Pure mathematics and physics: no clock, no input or output, no global randomness.

Read `lie` for the geometry, `integrators` for the methods, `effects` for the physics of a scene and
`vehicles` for the equations of motion of the vehicles.
"""

"""The commander: flight modes, missions, failsafes and operator commands.

`Commander.step` turns a `CommanderInput` into a `CommanderOutput`; its `State` is plain data. Imports go one way:
input, guidance, modes, state and output, then transitions, checks, failsafes and command handlers, then the commander.
"""

"""What the vehicle is to do now: flight modes, missions, failsafes, and the operator's commands.

`Commander.step` turns a frozen `View` of a tick into a frozen `Request`; what it remembers is a `State` of plain data.
Imports go one way: view, guidance, modes, state and request, then transitions, checks, failsafes and command handlers,
then the commander.
"""

"""Common parts of the adapters for other autopilot firmware.

An adapter is a service `services/FIRMWARE/` with the usual files. It needs a line in `services/process_table.py`, a
name in `schema.FIRMWARES`, and:

- `resolve.py`: `resolve(scene)` returns None unless `firmware_of(scene) == NAME`, else
  `setup.firmware_config(scene, inputs, period, own)`. `inputs` are the ports that the firmware consumes (sensors,
  truth, battery, trajectory), `period` [ticks] the time between two exchanges, `own` the adapter's NamedTuple of
  resolved values. `from lapwing.services.common.firmware.setup import fleet` numbers the instances of a fleet.
- `schema.py` (optional): a `SceneTable` with the adapter's own keys, for example `[px4]`.
- `service.py`: `create(setup, recorded=None)` returns `service.firmware_service(setup, NAME, Link, recorded)`.
- `link.py`: a class with the methods of `link.ExchangeLink` (lock step, the exchange in compiled code) or of
  `link.FirmwareLink` (every exchange in Python), constructed with a `setup.FirmwareSetup`.

Life cycle of a link:

1. `open(waits)`, before the first tick and outside the time of the run: start the program (`program.Program`) or wait
   for it, and connect. Every wait calls `waits(text)` at least every 0.2 s; it raises if the run is ended. Use
   `program.ProgramLink` for time-outs: it does not count time in which the firmware got no CPU. If it does not
   start or stalls, raise `link.FirmwareError("px4: no HIL_ACTUATOR_CONTROLS for 10 s at t = 3.2 s; ...")`.
2. `step(tick, read, waits)` every `period` ticks: `read("imu")` returns the port's newest sample as its NamedTuple of
   `services/common/ports.py` (SI, ENU, FLU). Return a `FirmwareOutput`: the firmware's own outputs in its own order
   (0 to 1), and its state.
3. `close()` once, also after an error: end the program if this link started it.

For an `ExchangeLink`, compiled code replaces `step`: `exchange.py` of the adapter has a NamedTuple of
parameters and `step(parameters, state, tick, inputs)`, which sends the samples, receives the outputs and writes the
command (`exchange`: memory shared with Python, samples, times). It calls Python (`ExchangeLink.handle_call`) if outputs
do not arrive within 0.2 s or are unexpected, and every 0.1 s of simulation to poll the MAVLink link of the mission.

The block (`block.FirmwareBlock`, `exchange_block.ExchangeBlock`) reorders the outputs to the airframe's rotors
(`motor_order`), and a compiled block (`hold`) converts them to volts at every tick: output times battery voltage, or
times `airframe.motor.max_voltage` if no effect models the battery. `link.report` (a `LinkReport`) goes to the log's
metadata as "firmware" and to the summary. `lapwing resimulate` does not open a link: it applies the recorded actuator
commands (`playback`).
"""

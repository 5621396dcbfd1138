"""Common parts of the adapters for other autopilot firmware.

An adapter is a service `services/FIRMWARE/`. It needs a line in `services/process_table.py`, a name in
`schema.FIRMWARES`, and:

- `resolve.py`: `resolve(scene)` returns None unless `firmware_of(scene) == NAME`, else
  `firmware_config.firmware_config(scene, inputs, period, own)`. `inputs` are the ports that the firmware consumes
  (sensors, truth, battery, trajectory), `period` [ticks] the time between two exchanges, `own` the adapter's
  NamedTuple of resolved values. `firmware_config.fleet` numbers the instances of a fleet.
- `schema.py` (optional): a `SceneTable` with the adapter's own keys, for example `[px4]`.
- `link.py`: `create = partial(service.firmware_service, name=NAME, link=Link)`. The link is a `link.ProgramLink`, which
  starts the program on free ports, keeps its logs and has time-outs that do not count time in which the firmware got no
  CPU. One with lock step and MAVLink is a `mavlink_link.MavlinkLink`.

Every `step` a link without compiled code returns a `FirmwareOutput`: the firmware's own outputs in its own order (0 to
1), and its state. `read("imu")` returns the port's newest sample as its NamedTuple of `services/common/ports.py` (SI,
ENU, FLU). With compiled code, `exchange.py` of the adapter has `exchange(parameters, tick)`, which sends the samples
and receives the outputs through a socket that it shares with Python (`channel`). Python is called (`handle_call`) if
outputs do not arrive within 0.2 s or are unexpected, and every 0.1 s of simulation to poll the mission's MAVLink link.

The block (`block`) reorders the outputs to the airframe's rotors (`motor_order`), and a compiled block (`hold`)
converts them to volts at every tick: output times battery voltage, or times `airframe.motor.max_voltage` if no effect
models the battery. `link.report` goes to the log's metadata as "firmware" and to the summary. `lapwing resimulate` does
not open a link: it applies the recorded actuator commands (`playback`).
"""

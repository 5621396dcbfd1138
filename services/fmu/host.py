"""Process of one FMU: `python -m lapwing.services.fmu.host SOCKET`. It obeys `host_process.HostProcess`."""

import base64
import hashlib
import json
import os
import socket
import struct
import sys
from pathlib import Path
from typing import Any

from lapwing.services.fmu.co_simulation import CoSimulation
from lapwing.services.fmu.instance import FmuInstance
from lapwing.services.fmu.service_config import CO_SIMULATION

LENGTH = struct.Struct("<q")


def instantiated(spec: dict[str, Any]) -> FmuInstance:
    """Extract, load and instantiate an FMU.

    Args:
        spec: its `FmuConfig` as a dictionary, and `folder` to extract it.

    Raises:
        ValueError: the file has changed, or the FMU cannot be instantiated.
    """
    import fmpy
    from fmpy.fmi2 import FMU2Model, FMU2Slave
    from fmpy.fmi3 import FMU3Model, FMU3Slave

    folder, is_3 = Path(spec["folder"]), spec["version"] == 3
    content = base64.b64decode(spec["content"]) if spec["content"] else Path(spec["path"]).read_bytes()
    if hashlib.sha256(content).hexdigest() != spec["sha256"]:
        raise ValueError("the file differs from the one that was resolved; restore it, or run the scene again")
    archive = folder / "model.zip"
    archive.write_bytes(content)
    fmpy.extract(str(archive), unzipdir=str(folder))
    model = fmpy.read_model_description(str(folder), validate=False)
    if spec["interface"] == CO_SIMULATION:
        kind, interface = FMU3Slave if is_3 else FMU2Slave, model.coSimulation
    else:
        kind, interface = FMU3Model if is_3 else FMU2Model, model.modelExchange
    identifier = interface.modelIdentifier
    fmu = kind(guid=model.guid, unzipDirectory=str(folder), instanceName=spec["name"], modelIdentifier=identifier)
    if spec["interface"] == CO_SIMULATION:
        return CoSimulation(spec, model, fmu)
    from lapwing.services.fmu.model_exchange import ModelExchange  # imports numba

    return ModelExchange(spec, model, fmu)


def _step(instance: FmuInstance, time: float, step: float, inputs: tuple[float, ...]) -> list[float]:
    """Set inputs, step or (if `step` is negative) initialise, and return the outputs.

    Raises:
        ValueError: the FMU reports an error; the text has its last message.
    """
    if step < 0.0:
        instance.initialise(inputs)
    else:
        if instance.ended is not None:
            raise ValueError(f"asked to end the simulation (t = {instance.ended:g} s)")
        instance.advance(time, step, inputs)
    return instance.outputs()


def serve(channel: socket.socket) -> None:
    """Run the FMU until the other end closes."""
    (size,) = LENGTH.unpack(_read(channel, LENGTH.size))
    spec = json.loads(_read(channel, size))
    request = struct.Struct(f"<{2 + len(spec['inputs'])}d")
    reply = struct.Struct(f"<q{len(spec['outputs'])}d")
    instance: FmuInstance | None = None
    while True:
        time, step, *inputs = request.unpack(_read(channel, request.size))
        try:
            instance = instance or instantiated(spec)
            channel.sendall(reply.pack(0, *_step(instance, time, step, tuple(inputs))))
        except Exception as error:  # FMPy raises many
            text = (" ".join(str(error).split()) or type(error).__name__).encode()[:500]
            channel.sendall(reply.pack(len(text), *([0.0] * len(spec["outputs"]))) + text)


def _read(channel: socket.socket, size: int) -> bytes:
    data = channel.recv(size)
    while len(data) < size:
        part = channel.recv(size - len(data))
        if not part:
            os._exit(0)  # the run is over; foreign code is not asked
        data += part
    return data


if __name__ == "__main__":
    serve(socket.socket(fileno=int(sys.argv[1])))

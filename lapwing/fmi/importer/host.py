"""Process of one FMU: `python -m lapwing.fmi.importer.host REQUESTS REPLIES`, controlled by `host_process.HostProcess`.

The arguments are file descriptors of pipes. Inputs and outputs of type double are not copied after the transfer over
the pipes.
"""

import base64
import ctypes
import hashlib
import json
import os
import signal
import struct
import sys
from pathlib import Path
from typing import Any

from lapwing.fmi.importer.co_simulation import CoSimulation, channel

LENGTH = struct.Struct("<q")


def instantiated(spec: dict[str, Any], inputs: Any, outputs: Any) -> CoSimulation:
    """Extract, load and instantiate an FMU.

    Args:
        spec: `FmuConfig` of the FMU as a dictionary, and `folder` to extract it.
        inputs, outputs: see `CoSimulation`.

    Raises:
        ValueError: the file has changed, or the FMU cannot be instantiated.
    """
    import fmpy
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    folder, is_3 = Path(spec["folder"]), spec["version"] == 3
    content = base64.b64decode(spec["content"]) if spec["content"] else Path(spec["path"]).read_bytes()
    if hashlib.sha256(content).hexdigest() != spec["sha256"]:
        raise ValueError("the file has changed since the start of the run; restore it, or run the scene again")
    archive = folder / "model.zip"
    archive.write_bytes(content)
    fmpy.extract(str(archive), unzipdir=str(folder))
    model = fmpy.read_model_description(str(folder), validate=False)
    identifier, kind = model.coSimulation.modelIdentifier, FMU3Slave if is_3 else FMU2Slave
    fmu = kind(guid=model.guid, unzipDirectory=str(folder), instanceName=spec["name"], modelIdentifier=identifier)
    return CoSimulation(spec, model, fmu, inputs, outputs)


def serve(requests: int, replies: int) -> None:
    """Run the FMU until the other end closes."""
    (size,) = LENGTH.unpack(_read(requests, bytearray(LENGTH.size)))
    spec = json.loads(_read(requests, bytearray(size)))
    n, m = len(spec["inputs"]), len(spec["outputs"])
    request, reply = bytearray(8 * (2 + n)), bytearray(8 * (1 + m))
    moment, inputs = (ctypes.c_double * 2).from_buffer(request), (ctypes.c_double * n).from_buffer(request, 16)
    status, outputs = ctypes.c_double.from_buffer(reply), (ctypes.c_double * m).from_buffer(reply, 8)
    pipes = channel(requests, replies, request, reply)
    instance: CoSimulation | None = None
    while True:
        try:
            if instance is not None and instance.has_numbers_in_place:
                instance.serve(pipes)
            else:
                _read(requests, request)
                instance = instance or instantiated(spec, inputs, outputs)
                if moment[1] < 0.0:
                    instance.initialise()
                else:
                    instance.advance(*moment)
            os.write(replies, reply)
        except Exception as error:  # FMPy raises exceptions of many classes
            text = (" ".join(str(error).split()) or type(error).__name__).encode()[:500]
            status.value = len(text)
            os.write(replies, reply + text)
            status.value = 0.0


def _read(channel: int, data: bytearray) -> bytearray:
    """Fill `data` from a pipe, and return it."""
    size = os.readv(channel, [data])
    while size < len(data):
        part = os.readv(channel, [memoryview(data)[size:]])
        if not part:
            os._exit(0)  # the run is over; foreign code is not called
        size += part
    return data


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the run decides when the FMU ends
    serve(*map(int, sys.argv[1:]))

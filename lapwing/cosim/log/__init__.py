"""MCAP logs: written during a run, read by replay and report. The only package that imports mcap.

Schemas are `ros2msg`, payloads `cdr`, log time and publish time are simulation time. The file grows by whole chunks; a
log whose writer was killed is readable up to its last chunk.
"""

from lapwing.cosim.log.log_reader import LogReader
from lapwing.cosim.log.log_writer import LogWriter, Part

__all__ = ["LogReader", "LogWriter", "Part"]

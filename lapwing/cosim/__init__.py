"""The co-simulation engine. It does not depend on any service: the process table is an argument.

Subpackages, in the order in which a run uses them:

- `scene`: reading, overriding and validating scene files.
- `config`: the resolved run configuration, its serialisation and provenance.
- `diagram`: ports, blocks, block diagrams and topic encoders.
- `executors`: the single-process executor, and the lock step of one participant.
- `transport`: Zenoh sessions, keys, step packets and log packets.
- `processes`: starting, supervising and monitoring the processes of a run.
- `log`: writing, reading, appending to and recovering MCAP logs.
- `access`: certificates, publisher GIDs, private sockets and Zenoh access control.

`run_errors` has the errors and exit codes that all of them share.
"""

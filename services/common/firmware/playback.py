"""Python block that applies the recorded commands of a firmware, without the firmware."""

from collections.abc import Iterable

from lapwing.cosim.diagram.block_diagram import BlockDiagram, Service
from lapwing.cosim.diagram.tick_schedule import Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.messages import Actuators, Status
from lapwing.messages import topics as topic
from lapwing.messages.topics import Topic
from lapwing.services.common import ports
from lapwing.services.common.ports import AutopilotStatus, MotorCommand

Recorded = dict[Topic, dict[int, bytes]]  # payloads by topic and tick
TOPICS = (topic.ACTUATORS, topic.STATUS, topic.SETPOINT)  # topics of an adapter


class Playback:
    """Block that writes the recorded motor commands to the ports, and publishes the recorded messages."""

    def __init__(self, name: str, outputs: Iterable[Port], recorded: Recorded, service: Service):
        """Create the block.

        Args:
            name: name of the service.
            outputs: ports of the service.
            recorded: messages of the service in the log.
            service: receiver of the messages.
        """
        self.name, self._recorded, self._service = f"{name}.playback", recorded, service
        self.outputs = tuple(outputs)
        self._status = AutopilotStatus()

    def bind(self, diagram: BlockDiagram) -> None:
        """Store the diagram."""
        self._diagram = diagram

    def on_tick(self, tick: int) -> int:
        """Write the samples at `tick`."""
        for name, payloads in self._recorded.items():
            if tick in payloads:
                self._service.messages.append((name, tick, payloads[tick]))
        if tick not in self._recorded[topic.ACTUATORS]:
            raise LockStepError(f"the log has no actuator command of tick {tick}; expected one at each tick")
        command = Actuators.decode(self._recorded[topic.ACTUATORS][tick])
        reference = command.attitude_reference
        volts = tuple(map(float, command.motor_voltage))
        motors = MotorCommand(
            volts, command.armed, tuple(map(float, command.thrust)), (reference.x, reference.y, reference.z)
        )
        self._diagram.put(ports.ACTUATORS, tick, motors)
        if payload := self._recorded[topic.STATUS].get(tick):
            x = Status.decode(payload)
            self._status = AutopilotStatus(0, 0, x.armed, x.landed, x.finished, x.battery_warning)
        self._diagram.put(ports.STATUS, tick, self._status)
        return tick + 1

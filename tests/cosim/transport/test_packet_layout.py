"""The published packet layout equals the layout of step packets."""

import pytest

from lapwing.cosim.config.serialise import to_json
from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.transport.packets import StepPacketCodec, layout
from lapwing.kernels.row_packing import pack_row
from lapwing.messages.message_diff import leaves
from lapwing.services.common.ports import MotorCommand, StateEstimate
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve


def test_columns_have_order_of_row():
    example = MotorCommand((1.0, 2.0, 3.0, 4.0), True, (5.0, 6.0, 7.0, 8.0), (9.0, 10.0, 11.0))
    named = dict(leaves(example))
    assert list(named.values()) == pack_row(example).tolist()
    assert named["motor_voltage.2"] == 3.0
    assert named["armed"] == 1.0
    assert named["attitude_reference.0"] == 9.0
    assert [column for column, _ in leaves(StateEstimate())][3:7] == [
        "attitude.w",
        "attitude.x",
        "attitude.y",
        "attitude.z",
    ]


@pytest.mark.long
def test_packet_length_equals_layout():
    config = resolve(load("hover"))
    reported = layout(config)
    assert reported["config"] == to_json(config)
    diagram = BlockDiagram(config, create_all(config), 64)
    diagram.advance(26)
    for name, service in reported["services"].items():
        for tick in (24, 25):
            expected = 8 * sum(len(p["columns"]) for p in service["ports"] if tick % p["period"] == 0)
            assert len(StepPacketCodec(config.services[name].ports).pack(diagram, tick)) == expected

"""Sensor messages: fields other than the reading."""

import numpy as np
import pytest

from lapwing.cosim.diagram.topic_encoder import encode
from lapwing.kernels.row_packing import pack_row
from lapwing.messages import stamp_ns
from lapwing.messages import topics as topic
from lapwing.services.process_table import create_all
from lapwing.services.scene_resolver import load, resolve


@pytest.mark.parametrize("which", [topic.GPS, topic.GPS_VELOCITY], ids=["fix", "velocity"])
def test_fix_is_stamped_with_its_moment_and_never_before_start(which):
    config = resolve(load("delivery_mission"))
    encoder = next(w for service in create_all(config) for w in service.encoders if w.topic is which)
    port = config.port(encoder.port)
    ticks = encoder.period * np.arange(4)
    rows = np.array([pack_row(port.example._replace(age=0.2))] * len(ticks))
    payloads = [payload.tobytes() for page in encode(encoder, port, config, ticks, rows) for payload in page.payloads]
    stamps = [stamp_ns(which.message.decode(payload).header) for payload in payloads]
    assert stamps == [0, 0, 0, 100_000_000]

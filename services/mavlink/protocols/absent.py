"""Services that this vehicle lacks; their askers are told so, rather than left to wait."""

from typing import TYPE_CHECKING, Any

from services.mavlink.client import Client
from services.mavlink.dialect import mavlink
from services.mavlink.protocols.handler import handles

if TYPE_CHECKING:
    from services.mavlink.adapter import Adapter

FTP_NAK, FTP_UNKNOWN_COMMAND, FTP_SIZE = 129, 7, 251


@handles("FILE_TRANSFER_PROTOCOL")
def no_files(adapter: "Adapter", client: Client, m: Any) -> None:
    """Refuse: sequence number, session, NAK, one byte of data, the request's code, and why."""
    sequence = (m.payload[0] | m.payload[1] << 8) + 1 & 0xFFFF
    answer = [sequence & 0xFF, sequence >> 8, m.payload[2], FTP_NAK, 1, m.payload[3], 0, 0, 0, 0, 0, 0]
    answer.append(FTP_UNKNOWN_COMMAND)
    payload = answer + [0] * (FTP_SIZE - len(answer))
    client.send(mavlink.MAVLink_file_transfer_protocol_message(0, client.system, client.component, payload))


@handles("LOG_REQUEST_LIST")
def no_logs(adapter: "Adapter", client: Client, m: Any) -> None:
    """There are none to fetch: the log of a run is the MCAP file."""
    client.send(mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0))


@handles("LOG_REQUEST_DATA")
def no_log_data(adapter: "Adapter", client: Client, m: Any) -> None:
    """The end of a log that is not there."""
    client.send(mavlink.MAVLink_log_data_message(m.id, m.ofs, 0, [0] * 90))


@handles("LOG_ERASE", "LOG_REQUEST_END")
def nothing_to_erase(adapter: "Adapter", client: Client, m: Any) -> None:
    """Done, as there is nothing."""


@handles("SERIAL_CONTROL")
def no_console(adapter: "Adapter", client: Client, m: Any) -> None:
    """No console: an empty reply."""
    client.send(mavlink.MAVLink_serial_control_message(m.device, mavlink.SERIAL_CONTROL_FLAG_REPLY, 0, 0, 0, [0] * 70))

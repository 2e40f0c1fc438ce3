"""Reads a capture that `Pcap` has written, record by record; the layout is that of `pcap.py`."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from emulator.pcap import LINK_TYPE, MAGIC
from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import open_regular
from fanet_mw.units import S

_FILE: Final = struct.Struct("<IHHiIII")
_RECORD: Final = struct.Struct("<IIII")
_TAP: Final = struct.Struct("<BBHIBBHH")
"""The radiotap fields of every record; then come those that its bits name, a byte each."""
_HAS_SIGNAL: Final = 1 << 5
_HAS_POWER: Final = 1 << 10
_ACK_BITS: Final = 0xD4
_FCS_BYTES: Final = 4
_ACK_BYTES: Final = 10 + _FCS_BYTES
_BEFORE_FRAME: Final = 24 + 8 + 20 + 8
"""The headers of 802.11, LLC, IP and UDP before a frame of the swarm."""
_MOST_BYTES: Final = 1 << 16


class AirFrame(NamedTuple):
    """One record of a capture."""

    t_ns: int
    """Swarm time, for the epoch that the reader was given: a transmission's first bit, a reception's last one."""
    what: str
    """`sent`, `received` or `ack`."""
    src: int | None
    """The sender; None for an ACK, which does not name it."""
    dst: int | None
    """The receiver; None: everyone."""
    station: int | None
    """The station that received it, modulo 256; None for transmissions."""
    frame_bytes: int
    """The payload of UDP; 0 for an ACK."""
    attempt: int | None
    """1: first transmission; None for receptions and ACKs."""
    rssi_dbm: int | None
    """Of a reception, if the channel knows powers."""
    payload: bytes = b""
    """Of a transmission: the frame of the swarm."""


def frames_of(path: Path, *, epoch_unix_ns: int) -> Iterator[AirFrame]:
    """The records of a capture; raises ConfigError for what is none, and where it is cut off."""
    try:
        with open_regular(path, follow=False) as file:
            head = file.read(_FILE.size)
            if len(head) < _FILE.size or (found := _FILE.unpack(head))[0] != MAGIC or found[-1] != LINK_TYPE:
                raise ConfigError(f"{path}: is no capture of radiotap frames with nanoseconds")
            yield from _records(file, path, epoch_unix_ns)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error


def _records(file: BinaryIO, path: Path, epoch_unix_ns: int) -> Iterator[AirFrame]:
    while head := file.read(_RECORD.size):
        at = file.tell()
        if len(head) < _RECORD.size:
            raise ConfigError(f"{path}: is cut off at byte {at}")
        seconds, rest_ns, size, _ = _RECORD.unpack(head)
        data = file.read(size) if size <= _MOST_BYTES else b""
        if len(data) < size or not _is_whole(data):
            raise ConfigError(f"{path}: is cut off, or no capture of this program, at byte {at}")
        yield _frame(data, seconds * S + rest_ns - epoch_unix_ns)


def _is_whole(data: bytes) -> bool:
    """True if an ACK, or a frame with all the headers before it, follows radiotap's fields."""
    if len(data) < _TAP.size:
        return False
    length = _TAP.unpack_from(data)[2]
    mac = data[length:]
    least = _ACK_BYTES if mac[:1] == bytes([_ACK_BITS]) else _BEFORE_FRAME + _FCS_BYTES
    return length > _TAP.size and len(mac) >= least


def _frame(data: bytes, t_ns: int) -> AirFrame:
    _, _, length, present, *_ = _TAP.unpack_from(data)
    mac, last = data[length:], data[length - 1]
    dst = _node(mac[4:10])
    if mac[0] == _ACK_BITS:
        return AirFrame(t_ns, "ack", None, dst, None, 0, None, None)
    size = len(mac) - _BEFORE_FRAME - _FCS_BYTES
    if present & _HAS_POWER:
        payload = mac[_BEFORE_FRAME : _BEFORE_FRAME + size]
        return AirFrame(t_ns, "sent", _node(mac[10:16]), dst, None, size, last + 1, None, payload)
    rssi_dbm = int.from_bytes(data[_TAP.size : _TAP.size + 1], "little", signed=True)
    return AirFrame(
        t_ns, "received", _node(mac[10:16]), dst, last, size, None, rssi_dbm if present & _HAS_SIGNAL else None
    )


def _node(address: bytes) -> int | None:
    return None if address == b"\xff" * 6 else int.from_bytes(address[4:6], "big")

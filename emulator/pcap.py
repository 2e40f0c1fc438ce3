"""A capture of what goes over the air: pcap with nanoseconds, radiotap, 802.11, LLC/SNAP, IPv4, UDP, the frame.

One record per transmission attempt, data and ACKs, stamped with its first bit; on request one per frame handed to a
station, stamped with its last bit. Layouts: libpcap (link type 127), radiotap.org, 802.11-2020 (9.2.4, 9.3.2.1,
9.3.1.4), RFC 1042, 791, 768 and 1071. Addresses are made of node ids: 02:FA:4E:45:hi:lo and 10.0.hi.lo. Not modeled:
beacons of the IBSS, ARP, fragmentation, frames overheard by other stations, copies that were lost.
"""

import struct
from collections.abc import Callable
from typing import Final, Protocol
from zlib import crc32

from fanet_mw.airtime import Timing, is_ofdm
from fanet_mw.scenario.tables.radio import Radio
from fanet_mw.units import BROADCAST, US, S

PORT: Final = 14550
LINK_TYPE: Final = 127
MAGIC: Final = 0xA1B23C4D
_FLAG_SHORT_PREAMBLE: Final = 0x02
_FLAG_FCS: Final = 0x10
_SENT: Final = 1 << 1 | 1 << 2 | 1 << 3 | 1 << 10 | 1 << 17
"""Radiotap fields of a transmission: flags, rate, channel, transmit power, data retries."""
_HEARD: Final = 1 << 1 | 1 << 2 | 1 << 3 | 1 << 5 | 1 << 11
"""Radiotap fields of a reception: flags, rate, channel, antenna signal, antenna (the receiver's id, modulo 256)."""
_HEARD_WITHOUT_POWER: Final = _HEARD & ~(1 << 5)
"""The same where the channel knows no powers."""
_CCK: Final = 0x0020
_OFDM: Final = 0x0040
_2_GHZ: Final = 0x0080
_5_GHZ: Final = 0x0100
"""Radiotap channel flags."""
_RETRY: Final = 0x08
_REMEMBERED: Final = 65_536
"""Frames whose number on the air is kept for their later attempts and receptions."""
_MAC_PREFIX: Final = b"\x02\xfaNE"
_EVERYONE: Final = b"\xff" * 6
_BSSID: Final = b"\x02\xfaNE\xff\xff"
_SNAP_IP: Final = b"\xaa\xaa\x03\x00\x00\x00\x08\x00"

_FILE = struct.Struct("<IHHiIII")
_RECORD = struct.Struct("<IIII")
_RADIOTAP = struct.Struct("<BBHIBBHHbB")
_RADIOTAP_WITHOUT_POWER = struct.Struct("<BBHIBBHHB")
_DATA = struct.Struct("<BBH6s6s6sH")
_ACK = struct.Struct("<BBH6s")
_FCS = struct.Struct("<I")
_IP = struct.Struct(">BBHHHBBH4s4s")
_UDP = struct.Struct(">HHHH")


class Capture(Protocol):
    """A recorder of what happens on the air, given to the medium by its host."""

    def transmitted(self, t_ns: int, src: int, dst: int, seq: int, frame: bytes, attempt: int) -> None: ...

    def acknowledged(self, t_ns: int, src: int, dst: int) -> None: ...

    def received(
        self, t_ns: int, station: int, src: int, dst: int, seq: int, frame: bytes, rssi_dbm: float
    ) -> None: ...

    def failure(self) -> str | None:
        """Write what was gathered; returns why the file ends before the run, None if it does not."""


def mac_address(node: int) -> bytes:
    """The locally administered MAC address of a node; that of the broadcast is all ones."""
    return _EVERYONE if node == BROADCAST else _MAC_PREFIX + node.to_bytes(2, "big")


def ip_address(node: int) -> bytes:
    """The address of a node in 10.0.0.0/16; that of the broadcast is 10.0.255.255."""
    return b"\x0a\x00" + node.to_bytes(2, "big")


def checksum(data: bytes) -> int:
    """The Internet checksum (RFC 1071): one's complement of the one's complement sum, which is the value mod 65535."""
    value = int.from_bytes(data, "big") << (8 * (len(data) & 1))
    return 0xFFFF - (value % 0xFFFF or 0xFFFF)


class Pcap:
    """Writes a capture; `epoch_unix_ns` may be set until the first record is written."""

    def __init__(
        self,
        write: Callable[[bytes], object],
        radio: Radio,
        *,
        receptions: bool = False,
        flush: Callable[[], str | None] = lambda: None,
    ) -> None:
        """`flush` returns why no more can be written; called once a second, so that the file can be read."""
        self.epoch_unix_ns = 0
        self._last: dict[int, int] = {}
        self._numbers: dict[tuple[int, int], int] = {}
        self._attempts: dict[int, int] = {}
        self._flush = flush
        self._flush_ns = S
        self.failure: Callable[[], str | None] = flush
        self.records = 0
        self._write = write
        self._receptions = receptions
        short = _FLAG_SHORT_PREAMBLE if radio.preamble == "short" else 0
        ofdm = is_ofdm(radio.rate_mbps)
        self._data_flags = _FLAG_FCS | (short if radio.rate_mbps > 1 and not ofdm else 0)
        self._ack_flags = _FLAG_FCS | (short if radio.ack_rate_mbps > 1 and not ofdm else 0)
        band = _5_GHZ if radio.standard == "a" else _2_GHZ
        self._channel = min(0xFFFF, round(radio.frequency_mhz)), band | (_OFDM if ofdm else _CCK)
        self._rate = round(2 * radio.rate_mbps)  # in 500 kb/s
        self._ack_rate = round(2 * radio.ack_rate_mbps)
        self._has_powers = radio.channel != "range"
        self._power_dbm = max(-128, min(127, round(radio.tx_power_dbm)))
        timing = Timing.of(radio)
        self._duration_us = -(-(timing.sifs_ns + timing.ack_ns) // US)
        write(_FILE.pack(MAGIC, 2, 4, 0, 0, 65535, LINK_TYPE))

    def transmitted(self, t_ns: int, src: int, dst: int, seq: int, frame: bytes, attempt: int) -> None:
        """Record that a data frame leaves an antenna, for the `attempt`-th time (from 1)."""
        tap = _RADIOTAP.pack(
            0, 0, _RADIOTAP.size, _SENT, self._data_flags, self._rate, *self._channel,
            self._power_dbm, min(255, attempt - 1),
        )  # fmt: skip
        if attempt == 1:
            self._last[src] = self._last.get(src, -1) + 1
            self._numbers[src, seq] = self._last[src]
            if len(self._numbers) > _REMEMBERED:
                del self._numbers[next(iter(self._numbers))]
        self._attempts[src] = attempt
        self._put(t_ns, tap, self._data(src, dst, self._number(src, seq), frame, retry=attempt > 1))

    def _number(self, src: int, seq: int) -> int:
        """The sequence number on the air, given at the first transmission (802.11-2020, 10.3.2.14)."""
        return self._numbers.get((src, seq), seq)

    def acknowledged(self, t_ns: int, src: int, dst: int) -> None:
        """Record that an ACK leaves an antenna."""
        tap = _RADIOTAP.pack(
            0, 0, _RADIOTAP.size, _SENT, self._ack_flags, self._ack_rate, *self._channel, self._power_dbm, 0
        )
        self._put(t_ns, tap, _ACK.pack(0xD4, 0, 0, mac_address(dst)))

    def received(self, t_ns: int, station: int, src: int, dst: int, seq: int, frame: bytes, rssi_dbm: float) -> None:
        """Record that a station has decoded a frame."""
        if not self._receptions:
            return
        known = self._data_flags, self._rate, *self._channel
        antenna = station & 0xFF
        if self._has_powers:
            signal_dbm = max(-128, min(127, round(rssi_dbm)))
            tap = _RADIOTAP.pack(0, 0, _RADIOTAP.size, _HEARD, *known, signal_dbm, antenna)
        else:
            size = _RADIOTAP_WITHOUT_POWER.size
            tap = _RADIOTAP_WITHOUT_POWER.pack(0, 0, size, _HEARD_WITHOUT_POWER, *known, antenna)
        retry = self._attempts.get(src, 1) > 1
        self._put(t_ns, tap, self._data(src, dst, self._number(src, seq), frame, retry=retry))

    def _put(self, t_ns: int, tap: bytes, frame: bytes) -> None:
        seconds, rest_ns = divmod(self.epoch_unix_ns + t_ns, S)
        size = len(tap) + len(frame) + _FCS.size
        self._write(_RECORD.pack(seconds, rest_ns, size, size) + tap + frame + _FCS.pack(crc32(frame)))
        self.records += 1
        if t_ns >= self._flush_ns:
            self._flush_ns = (t_ns // S + 1) * S
            self._flush()

    def _data(self, src: int, dst: int, seq: int, frame: bytes, *, retry: bool) -> bytes:
        """An 802.11 data frame without its FCS."""
        here, there = ip_address(src), ip_address(dst)
        size = 8 + len(frame)
        length = size.to_bytes(2, "big")
        pseudo = here + there + b"\x00\x11" + length
        ports = _UDP.pack(PORT, PORT, size, 0)
        udp = _UDP.pack(PORT, PORT, size, checksum(pseudo + ports + frame) or 0xFFFF)
        ip = _IP.pack(0x45, 0, 20 + size, seq & 0xFFFF, 0x4000, 64, 17, 0, here, there)
        ip = ip[:10] + checksum(ip).to_bytes(2, "big") + ip[12:]
        duration_us = 0 if dst == BROADCAST else self._duration_us
        mac = _DATA.pack(
            0x08, _RETRY if retry else 0, duration_us, mac_address(dst), mac_address(src), _BSSID, (seq & 0xFFF) << 4
        )
        return mac + _SNAP_IP + ip + udp + frame

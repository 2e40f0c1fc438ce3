"""MAVLink 2 signatures on the link to a ground station, by a key that both have (mavlink.io, Message Signing).

A time stamp counts as heard only once its signature was found right, so that a forged frame locks nobody out. What is
sent is later than all that was heard: a ground station whose clock is ahead would take it for a replay.
"""

import codecs
import hashlib
import hmac
from collections import Counter
from pathlib import Path
from typing import Final

from fanet_mw.errors import ConfigError
from fanet_mw.foreign_file import read_regular
from fanet_mw.gateway.framing import SIGNATURE, Frame, layout, with_crc
from fanet_mw.wire import OVERHEAD

_KEY_BYTES: Final = 32
_MOST_FILE_BYTES: Final = 4096
_EPOCH_UNIX_S: Final = 1_420_070_400
"""2015-01-01, from which signatures count."""
_UNIT_NS: Final = 10_000
_OLDEST: Final = 60 * 100_000
"""A first frame may be this much older than this gateway's clock, one minute, as MAVLink has it."""
_LATEST: Final = 1 << 47
"""No clock leads to stamps later than this, in the year 2059, so that they never run out."""
_MOST_STREAMS: Final = 1024
_LINK: Final = 0


def read_key(path: Path) -> bytes:
    """The key in a file: 32 bytes, or as many in hexadecimal; any other text is a passphrase, as MAVProxy hashes it."""
    content = read_regular(path, what=f"--mavlink-key {path}", most_bytes=_MOST_FILE_BYTES)
    text = content.removeprefix(codecs.BOM_UTF8).strip()
    is_line = content.endswith(b"\n") and text.isascii() and text.decode("ascii").isprintable()
    if len(content) == _KEY_BYTES and not is_line:  # else a passphrase of 31 characters, as an editor saves it
        return content
    if not text or len(text) > 1024:
        raise ConfigError(
            f"--mavlink-key {path}: {len(content)} bytes, must be 32, 64 hexadecimal digits or a passphrase"
        )
    try:
        given = bytes.fromhex(text.decode("ascii"))
    except ValueError:
        given = b""
    return given if len(given) == _KEY_BYTES else hashlib.sha256(text).digest()


class Signing:
    """Signs what goes to ground stations, and checks what comes from them."""

    def __init__(self, key: bytes, *, unix_ns: int) -> None:
        self._key = key
        self._sent = 0
        self._heard: dict[tuple[int, int, int], int] = {}
        """The last time stamp of each (link, system, component)."""
        self.follow(unix_ns)

    def follow(self, unix_ns: int) -> None:
        """It is this late now; what is sent counts up even if the clock does not."""
        self._now = (unix_ns - _EPOCH_UNIX_S * 1_000_000_000) // _UNIT_NS
        self._sent = max(self._sent, self._now)

    def signed(self, frame: bytes) -> bytes:
        shape = layout(int.from_bytes(frame[7:10], "little"))
        if frame[2] or shape is None:
            return frame
        body = with_crc(frame[:2] + b"\x01" + frame[3 : OVERHEAD - 2 + frame[1]], shape.crc_extra)
        self._sent += 1
        tail = bytes((_LINK,)) + self._sent.to_bytes(6, "little")
        return body + tail + self._hash(body + tail)

    def believes(self, frame: Frame, counts: Counter[str]) -> bool:
        """True for a frame that was signed by the key, later than all before it; else it is counted why not."""
        if not frame.signed:
            counts["unsigned"] += 1
            return False
        body, tail = frame.data[:-6], frame.data[-6:]
        if not hmac.compare_digest(self._hash(body), tail):
            counts["bad_signature"] += 1
            return False
        stream = body[-7], frame.system, frame.component
        stamp = int.from_bytes(body[-6:], "little")
        last = self._heard.get(stream)
        if stamp <= (self._now - _OLDEST if last is None else last):
            counts["replayed"] += 1
            return False
        if last is None and len(self._heard) >= _MOST_STREAMS:
            counts["too_many_senders"] += 1
            return False
        self._heard[stream] = stamp
        self._sent = max(self._sent, min(stamp, _LATEST))
        return True

    def _hash(self, covered: bytes) -> bytes:
        return hashlib.sha256(self._key + covered).digest()[:6]


def unsigned(frame: bytes) -> bytes:
    """A frame without its signature, as it goes on to the swarm."""
    shape = layout(int.from_bytes(frame[7:10], "little"))
    if not frame[2] or shape is None:
        return frame
    return with_crc(frame[:2] + b"\0" + frame[3 : len(frame) - SIGNATURE - 2], shape.crc_extra)

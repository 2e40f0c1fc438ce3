"""The MAVLink of a swarm by node and message: how often, how many bytes, and what the last one says."""

import json
from collections import deque
from typing import Any, Final, NamedTuple

from fanet_mw import wire
from fanet_mw.errors import MalformedFrameError
from fanet_mw.mavlink import common, decode
from fanet_mw.units import S
from fanet_mw.wire.frame import message_id

_WINDOW_S: Final = 5
"""Rates are those of so many seconds."""
_UNKNOWN: Final = "UNKNOWN"


class Key(NamedTuple):
    """One kind of message of one node."""

    node: int
    where: str
    """`tap`: on the node's tap; `air`: in the frames that it sent."""
    message_id: int


class Stream:
    """The messages of one kind from one node."""

    def __init__(self) -> None:
        self.count = 0
        self.bytes = 0
        self.first_ns = self.last_ns = 0
        self.frame = b""
        """The last one, as it was sent."""
        self._seconds: deque[tuple[int, int, int]] = deque(maxlen=_WINDOW_S + 1)
        """(second, messages, bytes) of the last seconds."""

    def take(self, t_ns: int, frame: bytes) -> None:
        if not self.count:
            self.first_ns = t_ns
        self.count += 1
        self.bytes += len(frame)
        self.last_ns, self.frame = t_ns, frame
        second = t_ns // S
        if self._seconds and self._seconds[-1][0] == second:
            _, messages, size = self._seconds[-1]
            self._seconds[-1] = second, messages + 1, size + len(frame)
        else:
            self._seconds.append((second, 1, len(frame)))

    def rates(self, now_ns: int) -> tuple[float, float]:
        """Messages and bytes per second, of the last whole seconds."""
        now = now_ns // S
        whole = [entry for entry in self._seconds if now - _WINDOW_S <= entry[0] < now]
        span = min(_WINDOW_S, now - self.first_ns // S)
        if span <= 0:
            return 0.0, 0.0
        return sum(entry[1] for entry in whole) / span, sum(entry[2] for entry in whole) / span

    def mean_rates(self, now_ns: int) -> tuple[float, float]:
        """Messages and bytes per second, of all the time until now."""
        span_s = now_ns / S
        return (self.count / span_s, self.bytes / span_s) if span_s else (0.0, 0.0)


class Field(NamedTuple):
    """One field of a message, for people."""

    name: str
    value: str
    unit: str
    meaning: str
    """The name of an enumerated value, or of the bits that are set."""


class Messages:
    """All that was said, by node and message."""

    def __init__(self) -> None:
        self.streams: dict[Key, Stream] = {}
        self.count = 0
        self.malformed = 0
        self._order: list[Key] = []

    def take(self, node: int, where: str, t_ns: int, data: bytes) -> None:
        try:
            for frame in wire.frames(data):
                self.count += 1
                key = Key(node, where, message_id(frame))
                stream = self.streams.get(key)
                if stream is None:
                    stream = self.streams[key] = Stream()
                stream.take(t_ns, frame)
        except MalformedFrameError:
            self.malformed += 1

    def found(self, words: str = "") -> list[Key]:
        """Those whose node, way and name have all of these words, in order."""
        if len(self._order) != len(self.streams):
            self._order = sorted(self.streams)
        wanted = words.lower().split()
        return [key for key in self._order if _fits(key, wanted)] if wanted else self._order


def _fits(key: Key, wanted: list[str]) -> bool:
    *exact, name = str(key.node), key.where, name_of(key.message_id).lower()
    return all(word in exact or word in name for word in wanted)


def name_of(message_id: int) -> str:
    known = common.mavlink_map.get(message_id)
    return f"{_UNKNOWN}_{message_id}" if known is None else str(known.msgname)


def fields_of(frame: bytes) -> list[Field]:
    """What a frame says; empty if it cannot be read."""
    try:
        (message,) = decode(frame)
    except MalformedFrameError:
        return []
    if message.get_type().startswith(_UNKNOWN):
        return [Field("payload", frame[10:-2].hex(" "), "", "")]
    return [
        Field(name, _shown(getattr(message, name)), message.fieldunits_by_name.get(name, ""), _meaning(message, name))
        for name in message.get_fieldnames()
    ]


def _shown(value: Any) -> str:  # noqa: ANN401  (a field of pymavlink)
    if isinstance(value, float):
        return f"{value:.7g}"
    if isinstance(value, list | tuple):
        few = [_shown(one) for one in value[:12]]
        return " ".join(few) + (f" .. ({len(value)})" if len(value) > len(few) else "")
    text = str(value)
    return text if text.isprintable() else json.dumps(text)


def _meaning(message: Any, name: str) -> str:  # noqa: ANN401
    kind, value = message.fieldenums_by_name.get(name), getattr(message, name)
    entries = common.enums.get(kind, {})
    if not isinstance(value, int) or not entries:
        return ""
    if value in entries and message.fielddisplays_by_name.get(name) != "bitmask":
        return _short(entries[value].name, kind)
    bits = [
        _short(entry.name, kind)
        for bit, entry in sorted(entries.items())
        if bit and value & bit == bit and "ENUM_END" not in entry.name
    ]
    return " | ".join(bits[:6]) + (f" and {len(bits) - 6} more" if len(bits) > 6 else "")


def _short(name: str, kind: str) -> str:
    return str(name).removeprefix(f"{kind}_")

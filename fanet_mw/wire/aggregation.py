"""Aggregation: several packets share one radio frame, a bundle, each with its own header.

The flag FLAG_MORE in a header says that another packet follows.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from fanet_mw.errors import MalformedFrameError
from fanet_mw.wire.frame import END_TO_END, ROUTE_ID, end_of_frame, with_more

_NOTHING: Final[Mapping[bytes, bytes]] = MappingProxyType({})


def aggregated(packets: Iterable[tuple[int, bytes]], *, most_bytes: int) -> Iterator[tuple[int, bytes, int]]:
    """As few frames as possible of at most `most_bytes` for packets in their order, each with its earliest instant and
    number of packets.
    """
    chunk: list[bytes] = []
    first_ns = size = 0
    for start_ns, packet in packets:
        if chunk and size + len(packet) > most_bytes:
            yield first_ns, bundle(chunk), len(chunk)
            chunk, size = [], 0
        first_ns = min(first_ns, start_ns) if chunk else start_ns
        chunk.append(packet)
        size += len(packet)
    if chunk:
        yield first_ns, bundle(chunk), len(chunk)


def bundle(packets: Sequence[bytes]) -> bytes:
    """One radio frame with several packets, or with a single one; the packets must have been decoded."""
    return b"".join((*(with_more(packet) for packet in packets[:-1]), packets[-1]))


def unbundle(frame: bytes, known: Mapping[bytes, bytes] = _NOTHING) -> list[bytes]:
    """The packets in a radio frame, as if alone; raises MalformedFrameError. `known`: inner frames cut out before."""
    starts, at, size = list[int](), 0, len(frame)
    while at < size:
        end = end_of_frame(frame, at)
        if frame[at + 7 : at + 10] == ROUTE_ID:
            starts.append(at)
            inner = known.get(frame[at + END_TO_END.start : at + END_TO_END.stop])
            if inner is not None and frame.startswith(inner, end):
                end += len(inner)
        at = end
    if not starts or starts[0]:
        raise MalformedFrameError("a bundle that does not begin with a routing header")
    return [frame[begin:end] for begin, end in zip(starts, [*starts[1:], size], strict=True)]

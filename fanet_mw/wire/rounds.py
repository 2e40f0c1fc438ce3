"""FANET_HEARD and FANET_HELD: what a node tells its neighbors in its turn of a round, beside the packets in it."""

import struct
from collections.abc import Sequence
from typing import Final, NamedTuple

from fanet_mw.units import NodeId
from fanet_mw.wire.checks import refuse_unless
from fanet_mw.wire.frame import HEARD, HELD, OVERHEAD, VERSION, Packed, decode_every, encode_inner

HEARD_BYTES: Final = OVERHEAD + HEARD.layout.size
HELD_BYTES: Final = OVERHEAD + HELD.layout.size
_DATA_BYTES: Final = 64
_ENTRY: Final = struct.Struct("<HB")
_OFTEN: Final = 1 << 15
"""The bit beside a node's number that stands for `often`."""
MOST_NODES: Final = 8 * (_DATA_BYTES - _ENTRY.size)
"""The number of nodes about which FANET_HEARD can tell."""
CAPACITY: Final = 16
"""Entries of one FANET_HELD."""


_new: Final = tuple.__new__  # for what is made once per entry


class HeardNodes(NamedTuple):
    """Whom a node hears."""

    node: NodeId
    epoch: int
    """The number of the hello interval, modulo 256."""
    heard: int
    """Bit i: it hears node i + 1."""
    often: bool = False
    """True for a node that takes part in all bulk slots."""


def heard_capacity(count: int) -> int:
    """The number of entries of one message in a swarm of so many nodes."""
    return _DATA_BYTES // (_ENTRY.size + -(-count // 8))


class HeldPacket(NamedTuple):
    """A packet that the sender has."""

    seq: int
    origin: int


def encode_heard(entries: Sequence[HeardNodes], node: int, *, count: int) -> bytes:
    """As many messages as the entries need, in a swarm of `count` nodes."""
    bits, most = -(-count // 8), heard_capacity(count)
    messages = []
    for at in range(0, len(entries), most):
        part = entries[at : at + most]
        data = b"".join(
            _ENTRY.pack(e.node | _OFTEN * e.often, e.epoch) + e.heard.to_bytes(bits, "little") for e in part
        )
        payload = data.ljust(_DATA_BYTES, b"\0") + bytes((len(part), _ENTRY.size + bits, VERSION))
        messages.append(encode_inner(HEARD, payload, node=node))
    return b"".join(messages)


def decode_heard(packed: Packed) -> list[HeardNodes]:
    """Whom nodes hear, as a frame tells; raises MalformedFrameError."""
    found: list[HeardNodes] = []
    for *data, count, length, version in decode_every(HEARD, packed):
        fits = length > _ENTRY.size and count * length <= _DATA_BYTES
        refuse_unless(
            version == VERSION and fits, f"heard nodes of version {version}: {count} entries of {length} bytes"
        )
        entries = bytes(data)
        for at in range(0, count * length, length):
            heard = int.from_bytes(entries[at + _ENTRY.size : at + length], "little")
            node, epoch = _ENTRY.unpack_from(entries, at)
            found.append(_new(HeardNodes, (node & ~_OFTEN, epoch, heard, node >= _OFTEN)))
    refuse_unless(all(0 < each.node <= MOST_NODES for each in found), "what a node hears that cannot exist")
    return found


def encode_held(packets: Sequence[HeldPacket], node: int) -> bytes:
    messages = []
    for at in range(0, len(packets), CAPACITY):
        part = packets[at : at + CAPACITY]
        unused = (0,) * (CAPACITY - len(part))
        seqs, origins = zip(*part, strict=True)
        payload = HELD.layout.pack(*seqs, *unused, *origins, *unused, len(part), VERSION)
        messages.append(encode_inner(HELD, payload, node=node))
    return b"".join(messages)


def decode_held(packed: Packed) -> list[HeldPacket]:
    """The packets that the sender of a frame holds; raises MalformedFrameError."""
    found: list[HeldPacket] = []
    for *lists, count, version in decode_every(HELD, packed):
        refuse_unless(version == VERSION and count <= CAPACITY, f"held packets of version {version}, {count} entries")
        found += map(HeldPacket, lists[:count], lists[CAPACITY : CAPACITY + count])
    return found

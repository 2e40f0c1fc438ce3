"""FANET_JOIN, by which a node asks the leader for a place in a cluster, and may report that another node is silent; and
FANET_SCHEDULE, the leader's division of the swarm into clusters, with their heads and slots.
"""

from typing import Final, NamedTuple, Self

from fanet_mw.errors import LocalProtocolError, MalformedFrameError
from fanet_mw.units import FARTHEST_M, FASTEST_M_S, STILL, Enu
from fanet_mw.wire.checks import place_within, require_sender
from fanet_mw.wire.frame import ANY_NODE, JOIN, SCHEDULE, VERSION, Packed, decode_first, encode_inner

CAPACITY: Final = 56
"""The number of entries in one part of a schedule."""


class Member(NamedTuple):
    """One entry of a schedule."""

    node: int
    cluster: int
    is_head: bool


_HEAD_BIT: Final = 0x8000


class Schedule(NamedTuple):
    """FANET_SCHEDULE: one part of the leader's assignment. Epoch 0 without members is a call to join."""

    start_us: int
    period_us: int
    slot_us: int
    epoch: int
    leader: int
    clusters: int
    part: int
    parts: int
    members: tuple[Member, ...]
    term: int = 0
    """The swarm second in which the leader took office."""

    def encode_frame(self, node: int) -> bytes:
        if len(self.members) > CAPACITY or self.clusters > _HEAD_BIT:
            raise LocalProtocolError(
                f"schedule of {len(self.members)} entries, {self.clusters} clusters: must be <= {CAPACITY}, {_HEAD_BIT}"
            )
        unused = (0,) * (CAPACITY - len(self.members))
        nodes = (*(m.node for m in self.members), *unused)
        assigned = (*(m.cluster | (_HEAD_BIT if m.is_head else 0) for m in self.members), *unused)
        last = (self.part, self.parts, len(self.members), VERSION)
        payload = SCHEDULE.layout.pack(*self[:3], self.term, *self[3:6], *nodes, *assigned, *last)
        return encode_inner(SCHEDULE, payload, node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        fields = decode_first(SCHEDULE, packed)
        part, parts, count, version = fields[-4:]
        nodes, assigned = fields[7 : 7 + CAPACITY], fields[7 + CAPACITY : 7 + 2 * CAPACITY]
        if count > CAPACITY or part >= parts:
            raise MalformedFrameError(f"schedule part {part} of {parts} with {count} entries")
        members = tuple(
            Member(node, entry & ~_HEAD_BIT, bool(entry & _HEAD_BIT))
            for node, entry in zip(nodes[:count], assigned[:count], strict=True)
        )
        start_us, period_us, slot_us, term, epoch, leader, clusters = fields[:7]
        schedule = cls(start_us, period_us, slot_us, epoch, leader, clusters, part, parts, members, term)
        require_sender(version, schedule.leader, t_us=start_us)
        if not 0 < slot_us * clusters <= period_us or bool(epoch) != bool(members):
            raise MalformedFrameError(
                f"schedule {epoch}: {clusters} slots of {slot_us} us in {period_us} us, {count} entries"
            )
        if not all(0 < member.node < ANY_NODE and member.cluster < clusters for member in members):
            raise MalformedFrameError(f"schedule {epoch}: an entry that is no node, or none of {clusters} clusters")
        if len({member.node for member in members}) < count:
            raise MalformedFrameError(f"schedule {epoch}: a node twice")
        return schedule


class Join(NamedTuple):
    """FANET_JOIN: a node asks the leader for a place in the next assignment."""

    node: int
    position: Enu
    velocity: Enu = STILL
    instead_of: int = 0
    """The silent node that the sender reports, or stands in for if it is its head; 0: none; its own id: it objects."""

    def encode_frame(self, node: int) -> bytes:
        payload = JOIN.layout.pack(*self.position, *self.velocity, self.node, self.instead_of, VERSION)
        return encode_inner(JOIN, payload, node=node)

    @classmethod
    def decode_frame(cls, packed: Packed) -> Self:
        *numbers, node, instead_of, version = decode_first(JOIN, packed)
        require_sender(version, node)
        if instead_of == ANY_NODE:
            raise MalformedFrameError(f"join of {node} instead of {instead_of}")
        position, velocity = place_within(*numbers[:3], most=FARTHEST_M), place_within(*numbers[3:], most=FASTEST_M_S)
        return cls(node, position, velocity, instead_of)

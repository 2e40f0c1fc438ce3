"""The cluster of a node by the newest schedule, whose parts may arrive in any order.

A schedule lists the members of each cluster in the order in which they stand in for each other, the head first. A node
that is in no part of a complete schedule belongs to no cluster. `joining.py` decides when a node asks for a place,
`states.py` how its role changes.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from fanet_mw import serial_number
from fanet_mw.routing.clustered.roles.leader_election import Authority
from fanet_mw.routing.clustered.roles.states import Event
from fanet_mw.routing.clustered.tdma.slot_timing import Superframe
from fanet_mw.trace import RoleChanged
from fanet_mw.units import US, NodeId
from fanet_mw.wire.hello.beacon import Role
from fanet_mw.wire.schedule import Member, Schedule


class ClusterPlace(NamedTuple):
    """A node's place in its cluster; a head of 0 means that the node belongs to no cluster."""

    role: Role = Role.ISOLATED
    cluster: int = 0
    head: NodeId = NodeId(0)

    def at(self, now_ns: int, node: NodeId) -> RoleChanged:
        return RoleChanged(now_ns, node, self.role.name.lower(), self.cluster, self.head)


class Version(NamedTuple):
    """The leader and the epoch of a schedule, which identify it."""

    authority: Authority
    epoch: int


EPOCH_BITS: Final = 16
"""The bits of a schedule's epoch, which wraps."""
_NOWHERE = ClusterPlace()


class Membership:
    """The newest schedule as one node knows it, and the node's place in it."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self.version: Version | None = None
        """The schedule of which parts have arrived; None before the first one."""
        self.place = _NOWHERE
        """The place of the node at present, which a failover may change before the next schedule does."""
        self.superframe: Superframe | None = None
        """The superframe with the slots of all clusters; None until a schedule has told this node's place."""
        self.succession: tuple[NodeId, ...] = ()
        """The members of this node's cluster: the head, then the others in the order in which they stand in for it."""
        self._parts: dict[int, Schedule] = {}
        self._named: ClusterPlace | None = None
        """The node's place by the last schedule that was complete enough to tell; it holds until a newer one is."""
        self._told = False
        """True if this version has told the node's place."""

    @property
    def epoch(self) -> int:
        return self.version.epoch if self.version else 0

    @property
    def role(self) -> Role:
        return self.place.role

    @property
    def cluster(self) -> int:
        return self.place.cluster

    @property
    def head(self) -> NodeId:
        return self.place.head

    @property
    def assigned(self) -> bool:
        return self.role is not Role.ISOLATED

    @property
    def is_head(self) -> bool:
        return self.role is Role.HEAD

    @property
    def slot(self) -> int:
        return self.cluster

    @property
    def parts(self) -> int:
        """The number of parts of this version that have arrived."""
        return len(self._parts)

    @property
    def named_head(self) -> NodeId:
        """The head that the schedule names for this node's cluster; 0 if none is known."""
        return self.succession[0] if self.succession else NodeId(0)

    @property
    def nodes_listed(self) -> int:
        return sum(len(part.members) for part in self._parts.values())

    def lists(self, node: int) -> bool:
        """True if the schedule names this node."""
        return any(member.node == node for part in self._parts.values() for member in part.members)

    def clusters(self) -> Mapping[NodeId, tuple[NodeId, ...]]:
        """The nodes of each cluster by its head; the head is also the first of them."""
        found: dict[int, list[Member]] = {}
        for part in sorted(self._parts):
            for member in self._parts[part].members:
                found.setdefault(member.cluster, []).append(member)
        in_order = (sorted(members, key=lambda m: not m.is_head) for members in found.values())
        return {NodeId(m[0].node): tuple(NodeId(one.node) for one in m) for m in in_order if m[0].is_head}

    def rank(self, node: int) -> int | None:
        return self.succession.index(NodeId(node)) if node in self.succession else None

    def learn(self, schedule: Schedule, *, guard_ns: int) -> Event | None:
        """Take in a part of a schedule; returns this node's event, once per version. The role changes with `obey`."""
        version = Version(Authority(schedule.term, schedule.leader), schedule.epoch)
        if version != self.version:
            if self.version and version.authority == self.version.authority and not newer(version, self.version):
                return None  # the part is from an older epoch, and arrived late
            self.version = version
            self._parts = {}
            self._told = False
        repeated = schedule.part in self._parts
        self._parts[schedule.part] = schedule
        event = self._find_ourselves(schedule, guard_ns)
        return None if repeated else event

    def _find_ourselves(self, schedule: Schedule, guard_ns: int) -> Event | None:
        members = [member for part in sorted(self._parts) for member in self._parts[part].members]
        mine = next((member for member in members if member.node == self._node), None)
        if mine is None:
            return Event.LEFT_OUT if len(self._parts) == schedule.parts else None
        own = [member for member in members if member.cluster == mine.cluster]
        head = next((NodeId(m.node) for m in own if m.is_head), None)
        if head is None:
            return None  # the head is in a part that has not arrived yet
        slot_ns = schedule.slot_us * US
        self.superframe = Superframe(
            schedule.start_us * US, schedule.period_us * US, slot_ns, min(guard_ns, max(0, slot_ns - 1))
        )
        self.succession = (head, *(NodeId(m.node) for m in own if m.node != head))
        known, self._told = self._told, True
        self._named = ClusterPlace(Role.HEAD if mine.is_head else Role.MEMBER, mine.cluster, head)
        return None if known else Event.NAMED_HEAD if mine.is_head else Event.NAMED_MEMBER

    def obey(self) -> None:
        """Take the place that the schedule gives to this node."""
        assert self._named is not None, "only a node that a schedule names has a role to take"
        self.place = self._named

    def follow(self, head: NodeId) -> None:
        """Another member, or this node itself, serves the cluster from now on."""
        self.place = self.place._replace(role=Role.HEAD if head == self._node else Role.MEMBER, head=head)

    def resign(self) -> None:
        """Give up the place in the cluster until another schedule names this node."""
        self.place, self.succession, self._named, self._told = _NOWHERE, (), None, False

    def forget(self) -> None:
        """Forget the schedule, so that the next one counts as new whatever its version is."""
        self.resign()
        self.version, self._parts = None, {}


def newer(version: Version, than: Version) -> bool:
    """True if `version` is later than another one of the same leader (16-bit serial numbers, RFC 1982)."""
    return serial_number.newer(version.epoch, than.epoch, bits=EPOCH_BITS)

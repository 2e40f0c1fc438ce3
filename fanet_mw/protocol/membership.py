"""Which cluster a node belongs to, as the newest schedule says. All parts of an epoch count, in any order."""

from typing import NamedTuple

from fanet_mw.protocol.slots import Superframe
from fanet_mw.trace import RoleChanged
from fanet_mw.units import US, NodeId
from fanet_mw.wire import Role, Schedule


class Change(NamedTuple):
    """What a schedule changed for this node."""

    node: NodeId
    role: Role
    cluster: int
    head: NodeId

    def at(self, now_ns: int) -> RoleChanged:
        return RoleChanged(now_ns, self.node, self.role.name.lower(), self.cluster, self.head)


class Membership:
    """One node's view of the schedule."""

    def __init__(self, node: NodeId) -> None:
        self._node = node
        self.epoch = 0
        self.role = Role.ISOLATED
        self.cluster = 0
        self.head = NodeId(0)
        self.superframe: Superframe | None = None
        self._parts: dict[int, Schedule] = {}

    @property
    def assigned(self) -> bool:
        return self.role is not Role.ISOLATED

    @property
    def is_head(self) -> bool:
        return self.role is Role.HEAD

    @property
    def slot(self) -> int:
        """Head of cluster k owns slot k."""
        return self.cluster

    def learn(self, schedule: Schedule, *, guard_ns: int) -> Change | None:
        """Take in one part; returns what changed for this node, if anything did."""
        if schedule.epoch != self.epoch:
            if self.epoch and not 0 < ((schedule.epoch - self.epoch) & 0xFFFF) < 0x8000:
                return None  # an older epoch, still on its way
            self.epoch = schedule.epoch
            self._parts = {}
        self._parts[schedule.part] = schedule
        slot_ns = schedule.slot_us * US
        self.superframe = Superframe(
            schedule.start_us * US, schedule.period_us * US, slot_ns, min(guard_ns, max(0, slot_ns - 1))
        )
        before = (self.role, self.cluster, self.head)
        self._find_ourselves()
        after = (self.role, self.cluster, self.head)
        return Change(self._node, *after) if after != before else None

    def _find_ourselves(self) -> None:
        members = [member for part in sorted(self._parts) for member in self._parts[part].members]
        mine = next((member for member in members if member.node == self._node), None)
        if mine is None:
            return
        head = next((m.node for m in members if m.cluster == mine.cluster and m.is_head), None)
        if head is None:
            return  # in a part that has not come yet
        self.role = Role.HEAD if mine.is_head else Role.MEMBER
        self.cluster, self.head = mine.cluster, NodeId(head)

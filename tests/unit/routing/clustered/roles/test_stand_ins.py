"""Which member stands in for a silent head, and until when: one node, by hand, with hellos every second."""

import pytest

from fanet_mw.node.neighbors import Neighbor, Neighbors
from fanet_mw.routing.clustered.forwarding.gradient import Gradient
from fanet_mw.routing.clustered.roles.failover import Failover
from fanet_mw.routing.clustered.roles.failure_detectors import Liveness
from fanet_mw.routing.clustered.roles.leader_election import Lease
from fanet_mw.routing.clustered.roles.membership import Membership
from fanet_mw.routing.clustered.roles.states import Action, State
from fanet_mw.units import MS, NodeId, S
from fanet_mw.wire.hello.beacon import Beacon, Role
from fanet_mw.wire.schedule import Member, Schedule

LEADER, HEAD = NodeId(1), NodeId(9)
CLUSTER = (9, 2, 3, 4)
"""The head, and those who stand in for it, in order."""


class Part:
    """One member, which heard its head's last hello at 3 s."""

    def __init__(self, node: int) -> None:
        name, liveness = NodeId(node), Liveness()
        self.member = Membership(name)
        self.gradient = Gradient(node=name, neighbors=Neighbors(lifetime_ns=4 * S), hello_ns=S)
        lease = Lease(name, period_ns=20 * S, liveness=liveness)
        self.failover = Failover(
            membership=self.member, gradient=self.gradient, liveness=liveness, lease=lease, node=name, hello_ns=S,
            takes_slot=True,
        )  # fmt: skip
        self.failover.start(0, leads=False)
        members = tuple(Member(other, 0, other == HEAD) for other in CLUSTER)
        schedule = Schedule(0, 20_000_000, 20_000_000, 1, LEADER, 1, 0, 1, members, 0)
        assert self.failover.on_schedule(schedule, guard_ns=0, born_ns=1 * S, now_ns=1 * S) == [
            Action.JOIN,
            Action.FOLLOW,
        ]
        self.gradient.join(HEAD, now_ns=1 * S)
        for second in (2, 3):
            self.gradient.on_hello(Neighbor(HEAD, second * S, -60.0, self._beacon(second)), now_ns=second * S)

    def _beacon(self, seq: int) -> Beacon:
        return Beacon(HEAD, HEAD, seq, 0, 1, 0, Role.HEAD, 0)

    def takes_over_ns(self, until_ns: int = 15 * S) -> int | None:
        """When it stands in, woken just when it asks to be."""
        while (wake_ns := self.failover.next_wake_ns()) is not None and wake_ns <= until_ns:
            if Action.TAKE_OVER in self.failover.wake(wake_ns):
                return wake_ns
        return None


@pytest.mark.parametrize(("node", "after_ms"), [(2, 4000), (3, 4500), (4, 5000)])
def test_members_stand_in_for_a_silent_head_one_after_the_other(node: int, after_ms: int) -> None:
    assert Part(node).takes_over_ns() == 3 * S + after_ms * MS


def test_a_head_that_the_mac_has_given_up_is_silent_sooner() -> None:
    part = Part(2)
    part.failover.on_unreachable(HEAD, now_ns=4 * S)
    assert part.takes_over_ns() == 5 * S


def test_a_head_is_back_with_what_it_generated_after_it_was_stood_in_for() -> None:
    part = Part(2)
    acting_ns = part.takes_over_ns()
    assert acting_ns is not None
    assert part.failover.state is State.ACTING
    assert part.failover.on_sign_of_life(HEAD, born_ns=acting_ns - 1, now_ns=acting_ns + S) == []
    assert part.member.head == 2, "that was still under way when it fell silent"
    assert part.failover.on_sign_of_life(HEAD, born_ns=acting_ns + 1, now_ns=acting_ns + S) == [Action.FOLLOW]
    assert part.member.head == HEAD

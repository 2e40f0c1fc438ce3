"""The transmit queue beside a plain list: what goes out, what expires, and what has to go for another, in any order."""

from typing import Final

from hypothesis import example, given
from hypothesis import strategies as st

from fanet_mw.errors import DropReason
from fanet_mw.node.packet import Packet
from fanet_mw.node.queue import TxQueue
from fanet_mw.scenario import Routing
from fanet_mw.units import BROADCAST, US, NodeId, S
from fanet_mw.wire import PRIORITY_BULK, PRIORITY_CONTROL, Header, Kind

CAPACITY: Final = 4
SOONER_US: Final = {1: 30, 2: 10}
"""Safety and reports live so much shorter than bulk."""
ROUTING: Final = Routing(
    queue_frames=CAPACITY,
    lifetime_s=1,
    safety_lifetime_s=1 - SOONER_US[1] / 1e6,
    report_lifetime_s=1 - SOONER_US[2] / 1e6,
)
PUSHES = st.tuples(
    st.just("push"),
    st.integers(0, 100),
    st.integers(PRIORITY_CONTROL, PRIORITY_BULK),
    st.none() | st.integers(0, PRIORITY_BULK + 1),
)
EXPIRIES = st.tuples(st.just("expire"), st.integers(0, 120))


def packet(number: int, born_us: int, priority: int) -> Packet:
    header = Header(born_us, number, NodeId(1), BROADCAST, NodeId(1), Kind.DATA, 8, 0, priority, 0)
    return Packet(header, header.encode())


@example([("push", 70, 1, 3), ("expire", 60)])  # a warning for which there is only bulk's room
@given(st.lists(PUSHES | EXPIRIES | st.just(("pop",)), max_size=30))
def test_a_queue_holds_what_a_sorted_list_would(steps: list[tuple[object, ...]]) -> None:
    dropped: list[tuple[DropReason, Packet]] = []

    def drop(reason: DropReason, packet: Packet, *, now_ns: int) -> None:
        dropped.append((reason, packet))

    queue, model = TxQueue(ROUTING, drop), list[tuple[int, int, Packet]]()
    for number, step in enumerate(steps):
        dropped.clear()
        match step:
            case ("push", int(born_us), int(priority), rank):
                one = packet(number, born_us, priority)
                place = priority if rank is None else rank
                assert isinstance(place, int)
                model = sorted([*model, (place, number, one)])
                expected = [(DropReason.QUEUE_FULL, model.pop()[2])] if len(model) > CAPACITY else []
                queue.push(one, rank=place if rank is not None else None, now_ns=0)
                assert dropped == expected
            case ("expire", int(before_us)):
                stale = [e for e in model if e[2].header.origin_us < before_us + SOONER_US.get(e[2].header.priority, 0)]
                model = [e for e in model if e not in stale]
                queue.expire(now_ns=S + before_us * US)
                assert dropped == [(DropReason.EXPIRED, e[2]) for e in stale]
            case ("pop",) if model:
                assert queue.pop() == model.pop(0)[2]
        assert len(queue) == len(model)

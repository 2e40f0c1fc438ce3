"""The way of a packet through one node: which files it enters, in order, each from one other file alone.

Every call that is handed the packet is traced, and where it came from. What ARCHITECTURE.md says is read and compared.
"""

import itertools
import sys
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from fanet_mw.bus.messages import Reception
from fanet_mw.node.node import Node
from fanet_mw.node.packet import Packet
from fanet_mw.routing import make_protocol
from fanet_mw.routing.clustered.clustered import Clustered
from fanet_mw.routing.clustered.tdma.turn_timing import Turns
from fanet_mw.routing.clustered.timetable.node_timetable import FittedTimetable, NodeTimetable
from fanet_mw.routing.clustered.timetable.timetable import Timetable, Turn
from fanet_mw.routing.clustered.timetable.turn_access import TurnAccess
from fanet_mw.scenario import Scenario, config
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S
from fanet_mw.wire import FLAG_FLOOD, PRIORITY_BULK, PRIORITY_REPORT, Header, Kind, filler

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "fanet_mw"
INNER = filler(40, node=3)
VALUES = ("fanet_mw/wire/", "fanet_mw/node/packet.py")
"""Bytes and plain values, which have no state and are at hand everywhere."""


def carries(value: Any, depth: int = 2) -> bool:
    """Whether an argument is the packet, or has it in it."""
    if isinstance(value, bytes):
        return INNER in value
    if isinstance(value, Packet | Reception):
        return any(carries(part) for part in value)
    return depth > 0 and type(value) in (list, tuple) and any(carries(part, depth - 1) for part in value)


class Way:
    """The files that a packet enters during one call from outside, and from which file each is entered."""

    def __init__(self) -> None:
        self.files: list[str] = []
        self.callers: dict[str, set[str]] = {}

    def trace(self, frame: FrameType, event: str, _: object) -> None:
        if event != "call" or not any(carries(value) for value in list(frame.f_locals.values())):
            return
        chain: list[str] = []
        at: FrameType | None = frame
        while at is not None:
            path = Path(at.f_code.co_filename)
            if path.is_relative_to(PACKAGE):
                name = str(path.relative_to(ROOT))
                if not name.startswith(VALUES) and (not chain or chain[-1] != name):
                    chain.append(name)
            at = at.f_back
        chain.reverse()
        for caller, name in itertools.pairwise(chain):
            self.callers.setdefault(name, set()).add(caller)
        self.files += [name for name in dict.fromkeys(chain) if name not in self.files]


def way(call: Callable[[], object]) -> Way:
    found = Way()
    sys.setprofile(found.trace)
    try:
        call()
    finally:
        sys.setprofile(None)
    return found


def send(node: Node, now_ns: int, *, priority: int = PRIORITY_BULK) -> None:
    node.send(INNER, destination=BROADCAST, priority=priority, app="test", born_ns=now_ns, now_ns=now_ns)


def hear(node: Node, at_ns: int, *, origin: int, priority: int = PRIORITY_BULK) -> None:
    header = Header(at_ns // 1000 - 5000, 7, origin, BROADCAST, origin, Kind.DATA, 9, 0, priority, FLAG_FLOOD)
    node.hear(Reception(header.encode() + INNER, NodeId(origin), at_ns, -60.0), at_ns)


def node_of(node: int, scenario: Scenario) -> Node:
    made = Node(NodeId(node), scenario, make_protocol, position=Enu(0.0, 0.0, 50.0))
    made.start(0)
    return made


def flooded() -> dict[str, Way]:
    node = node_of(2, config.build({"nodes": {"count": 5}, "routing": {"protocol": "flooding"}}))
    return {"handed over": way(lambda: send(node, 0)), "heard": way(lambda: hear(node, S, origin=3))}


def in_rounds() -> dict[str, Way]:
    """A survivor report at the second of five nodes."""
    node = node_of(2, config.build({"nodes": {"count": 5}, "routing": {"protocol": "rounds"}}))
    over = way(lambda: send(node, 0, priority=PRIORITY_REPORT))
    heard = way(lambda: hear(node, 10 * MS, origin=3, priority=PRIORITY_REPORT))
    out = Way()
    while not node.requests:
        wake_ns = node.next_wake_ns()
        assert wake_ns is not None
        out = way(partial(node.wake, wake_ns))
    return {"handed over": over, "heard": heard, "let out": out}


def scheduled() -> dict[str, Way]:
    """Node 2 has turn 12 for packets of its own, and turn 8 for those that node 3 lets out in turn 5."""
    tree = {
        "nodes": {"count": 5},
        "clusters": {"relay": "scheduled", "flooding_period_s": 0.1},
        "radio": {"lead_ms": 2},
        "traffic": {"interval_s": 1},
    }
    node, us, root = node_of(2, config.build(tree)), NodeId(2), NodeId(3)
    turns = Turns(origin_ns=0, period_ns=100 * MS, contention_ns=40 * MS, turn_ns=2 * MS, per_superframe=29)
    floods = (Turn(5, root, root, 0), Turn(8, us, root, 0), Turn(12, us, us, 0), Turn(14, root, us, 0))
    table = Timetable(floods, {root: 5, us: 3}, {root: (), us: ()}, len(floods))
    protocol = node._protocol
    assert isinstance(protocol, Clustered)
    access = protocol.parts.access
    assert isinstance(access, TurnAccess)
    access.follow(
        NodeTimetable.of(us, 0, FittedTimetable(turns, table, together=1, frame_bytes=1024, whole=True, enough=True)),
        now_ns=0,
    )
    over = way(lambda: send(node, 0))
    out = way(lambda: node.wake(64 * MS - 2 * MS))
    heard = way(lambda: hear(node, turns.start_ns(5, superframe_start_ns=1000 * MS) + MS, origin=3))
    return {"handed over": over, "let out": out, "heard": heard}


WAYS = {"flooded": flooded, "in rounds": in_rounds, "scheduled": scheduled}


def rows(ways: dict[str, dict[str, Way]]) -> Iterable[str]:
    """The table of ARCHITECTURE.md."""
    for kind, passes in ways.items():
        for direction, found in passes.items():
            names = [f"`{name.removeprefix('fanet_mw/')}`" for name in found.files]
            yield f"| {kind} | {direction} | {', '.join(names)} |"


@pytest.mark.parametrize("kind", WAYS)
def test_a_packet_enters_each_file_once_and_nothing_calls_back_up(kind: str) -> None:
    for direction, found in WAYS[kind]().items():
        assert found.files[0] == "fanet_mw/node/node.py"
        assert "fanet_mw/node/node.py" not in found.callers, "nothing calls back up into the node"
        several = {name: sorted(callers) for name, callers in found.callers.items() if len(callers) > 1}
        assert not several, f"{direction}: entered from several files"


def test_the_way_of_a_packet_is_as_the_architecture_says() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    said = [line for line in text.splitlines() if line.startswith(tuple(f"| {kind} |" for kind in WAYS))]
    assert said == list(rows({kind: trace() for kind, trace in WAYS.items()}))


if __name__ == "__main__":
    page = ROOT / "ARCHITECTURE.md"
    before, after = (part := page.read_text().partition("<!-- end of way -->"))[0], "".join(part[1:])
    head = "| packet | direction | files |\n|---|---|---|\n"
    table = "".join(f"{row}\n" for row in rows({kind: trace() for kind, trace in WAYS.items()}))
    page.write_text(before[: before.index(head) + len(head)] + table + after)

"""The contract of a routing protocol as tests, for a protocol of another package to run against itself
(docs/how-to/extend.md).

Nine nodes on a grid of 3 x 3, 200 m apart, range 250 m, send over the real medium in virtual time; and single nodes are
driven by hand with frames that no protocol would send.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from importlib import import_module
from random import Random
from typing import Any, ClassVar, Final, Literal, NamedTuple

import pytest

from fanet_mw import wire
from fanet_mw.application import Application
from fanet_mw.bus.messages import Reception, TxOutcome, TxRequest, TxStatus
from fanet_mw.errors import DropReason, LocalProtocolError
from fanet_mw.node.node import Node
from fanet_mw.routing import make_protocol
from fanet_mw.scenario import Scenario, config
from fanet_mw.trace import Delivered, Dropped, Generated
from fanet_mw.units import BROADCAST, MS, Enu, NodeId, S

Destination = int | Literal["all"]
_AIRTIME_NS: Final = 1 * MS
_REPEATED: Final = 3
"""The number of packets of the greatest length at each priority: the air may take one."""


class ContractRun(NamedTuple):
    """The outcome of one run and its summary."""

    outcome: Any
    summary: Mapping[str, Any]


class RoutingContract:
    """A test suite: subclass it in a test module, and name the protocol."""

    protocol: ClassVar[str]
    """The protocol as `routing.protocol` names it: an entry point, or MODULE:CLASS."""
    options: ClassVar[Mapping[str, object]] = {}
    """The table `[routing.options]`."""
    least_delivered: ClassVar[float] = 0.9
    """Share of the packets that must arrive in a connected swarm at rest."""
    hello_interval_s: ClassVar[float] = 1.0
    """The hello interval; 0 if the protocol needs no hellos."""

    def scenario(self, destination: Destination, *, moving: bool) -> Scenario:
        """Nine nodes, each with a packet a second for one node or for all."""
        return config.build(
            {
                "name": "contract", "duration_s": 22, "warmup_s": 7, "drain_s": 5,
                "nodes": {"count": 9, "layout": "grid", "columns": 3, "telemetry_hz": 0},
                "traffic": {"destination": destination, "payload_bytes": 300},
                "routing": {"protocol": self.protocol, "options": dict(self.options),
                            "hello_interval_s": self.hello_interval_s},
                "radio": {"lead_ms": 5},
                "world": {"area_m": 700},
                "mobility": {"model": "random_waypoint" if moving else "static", "speed_m_s": 15},
            }
        )  # fmt: skip

    def run(self, destination: Destination, *, moving: bool) -> ContractRun:
        return _run(json.dumps(self.scenario(destination, moving=moving).model_dump(mode="json")))

    # --- over the real medium -------------------------------------------------------------------------------------

    @pytest.mark.parametrize("moving", [False, True], ids=["still", "moving"])
    @pytest.mark.parametrize("destination", [1, "all"])
    def test_every_frame_is_accounted_for(self, destination: Destination, moving: bool) -> None:
        summary = self.run(destination, moving=moving).summary
        assert summary["frames"]["closes"]
        assert summary["frames"]["sent"] > 0
        assert summary["generated"] >= 80

    @pytest.mark.parametrize("destination", [1, "all"])
    def test_a_connected_swarm_at_rest_gets_nearly_all(self, destination: Destination) -> None:
        assert self.run(destination, moving=False).summary["pdr"] >= self.least_delivered

    @pytest.mark.parametrize("moving", [False, True], ids=["still", "moving"])
    @pytest.mark.parametrize("destination", [1, "all"])
    def test_each_packet_is_delivered_once_and_to_whom_it_is_for(self, destination: Destination, moving: bool) -> None:
        delivered = [r for r in self.run(destination, moving=moving).outcome.records if isinstance(r, Delivered)]
        assert len({(r.node, r.origin, r.seq) for r in delivered}) == len(delivered)
        assert all(r.node != r.origin for r in delivered)
        assert destination == "all" or {r.node for r in delivered} <= {destination}

    def test_the_same_seed_gives_the_same_trace(self) -> None:
        scenario = self.scenario(1, moving=True)
        again = _fresh_run(scenario)
        assert again.summary["trace_sha256"] == self.run(1, moving=True).summary["trace_sha256"]

    def test_a_packet_of_the_greatest_stated_length_leaves_its_node(self) -> None:
        """`most_packet_bytes` is what messages of applications are cut to: what is longer must be refused at once, and
        nothing that it allows may be dropped on its way for its length.
        """
        scenario = self.scenario("all", moving=False)
        node = _Bench(scenario).node
        lengths = {priority: node.most_packet_bytes(priority) for priority in wire.PRIORITIES.values()}
        assert all(wire.HEADER_BYTES < most <= scenario.radio.max_frame_bytes for most in lengths.values()), lengths
        for priority, most in lengths.items():
            with pytest.raises(LocalProtocolError):
                node.send(
                    bytes(most + 1 - wire.HEADER_BYTES), destination=BROADCAST, priority=priority, app=_Longest.name,
                    born_ns=0, now_ns=0,
                )  # fmt: skip
        outcome = _fresh_run(scenario, lambda node: [_Longest(lengths)] if node == 5 else []).outcome
        made = [r.seq for r in outcome.records if isinstance(r, Generated) and r.app == _Longest.name]
        heard = {r.seq for r in outcome.records if isinstance(r, Delivered) and r.origin == 5}
        assert len(made) == _REPEATED * len(lengths)
        for index, (priority, most) in enumerate(lengths.items()):
            assert heard.intersection(made[index :: len(lengths)]), f"packets of {most} bytes, priority {priority}"
        assert DropReason.TOO_LARGE not in {r.reason for r in outcome.records if isinstance(r, Dropped)}

    # --- one node, driven by hand ---------------------------------------------------------------------------------

    def test_what_the_air_brings_never_raises(self) -> None:
        """Frames are complete, cut off, or have flipped bits, and come from neighbors and from unknown nodes."""
        random = Random(1)
        bench = _Bench(self.scenario(3, moving=False))
        for frame in _hostile(random, 400):
            bench.hear(frame, src=random.choice((2, 3, 9, 40_000)))
            bench.pass_ns(random.randrange(300) * MS)
        assert bench.node.receptions >= 400

    def test_a_wake_up_that_has_come_is_done(self) -> None:
        """`next_wake_ns` after `wake` is in the future; otherwise a host would never advance."""
        random = Random(2)
        bench = _Bench(self.scenario("all", moving=False))
        for _ in range(40):
            bench.send()
            bench.hear(_data(random, seq=random.randrange(1 << 31)), src=2)
            bench.pass_ns(random.randrange(1, 2000) * MS)
            due_ns = bench.node.next_wake_ns()
            assert due_ns is None or due_ns > bench.now_ns

    def test_nothing_is_announced_for_an_instant_that_is_past(self) -> None:
        random = Random(3)
        bench = _Bench(self.scenario("all", moving=False))
        for _ in range(40):
            bench.send()
            bench.hear(_data(random, seq=random.randrange(1 << 31)), src=2)
            bench.pass_ns(random.randrange(1, 500) * MS)
        assert bench.requests
        assert all(request.start_ns >= announced_ns for announced_ns, request in bench.requests)

    def test_its_report_is_json(self) -> None:
        bench = _Bench(self.scenario("all", moving=False))
        bench.send()
        bench.pass_ns(3 * S)
        assert json.loads(json.dumps(bench.node.report())) is not None


@lru_cache(maxsize=16)
def _run(scenario_json: str) -> ContractRun:
    return _fresh_run(config.build(json.loads(scenario_json)))


def _fresh_run(scenario: Scenario, applications: Callable[[int], Sequence[Application]] = lambda _: ()) -> ContractRun:
    """A run by the simulation layers, which are imported by name because this layer must not depend on them."""
    outcome = import_module("sim.run.virtual").simulate(scenario, applications=applications)
    return ContractRun(outcome, import_module("sim.results.files").finish(outcome, out=None))


class _Longest(Application):
    """Sends packets of the given length at each priority in turn, when the swarm has been up for 8 s."""

    name = "longest"

    def __init__(self, lengths: Mapping[int, int]) -> None:
        self._to_send = list(lengths.items()) * _REPEATED
        self._due_ns = 8 * S

    def next_wake_ns(self) -> int | None:
        return self._due_ns if self._to_send else None

    def wake(self, now_ns: int) -> None:
        priority, most = self._to_send.pop(0)
        self._due_ns = now_ns + S
        self.port.send(wire.filler(most - wire.HEADER_BYTES), priority=priority)


class _Bench:
    """One node, and a channel on which each frame is finished after one millisecond and received by nobody."""

    def __init__(self, scenario: Scenario) -> None:
        self.now_ns = 0
        self.requests: list[tuple[int, TxRequest]] = []
        """The requests, each with the instant at which it was announced."""
        self.node = Node(NodeId(1), scenario, make_protocol, position=Enu(0.0, 0.0, 50.0))
        self.node.start(0)
        self._collect()

    def send(self) -> None:
        self.node.send(
            wire.filler(40), destination=BROADCAST, priority=3, app="contract", born_ns=self.now_ns, now_ns=self.now_ns
        )
        self._collect()

    def hear(self, frame: bytes, *, src: int) -> None:
        reception = Reception(frame, NodeId(src), self.now_ns, -70.0)
        self.node.hear(reception, self.now_ns)
        self._collect()

    def pass_ns(self, span_ns: int) -> None:
        """Let time pass, waking the node as a host does."""
        end_ns = self.now_ns + span_ns
        for _ in range(10_000):
            due_ns = self.node.next_wake_ns()
            if due_ns is None or due_ns > end_ns:
                break
            self.now_ns = max(self.now_ns, due_ns)
            self.node.wake(self.now_ns)
            self._collect()
        else:
            raise AssertionError("the protocol wants to be woken without end")
        self.now_ns = end_ns

    def _collect(self) -> None:
        for request in self._drained():
            self.requests.append((self.now_ns, request))
            if request.wants_status:
                done_ns = max(self.now_ns, request.start_ns) + _AIRTIME_NS
                self.node.on_status(TxStatus(request.seq, TxOutcome.RETRY_LIMIT, done_ns, 7), now_ns=self.now_ns)

    def _drained(self) -> list[TxRequest]:
        found = list(self.node.requests)
        self.node.requests.clear()
        return found


def _data(random: Random, *, seq: int) -> bytes:
    header = wire.Header(0, seq, 5, random.choice((1, 3, 0xFFFF)), 2, wire.Kind.DATA, 8, 1, 3, 0)
    return header.encode() + wire.filler(40)


def _hostile(random: Random, count: int) -> Iterator[bytes]:
    for seq in range(count):
        kind = random.choice(list(wire.Kind))
        destination = random.choice((1, 3, 0xFFFF, random.randrange(1, 0xFFFF)))
        origin = random.randrange(1, 0xFFFF)
        fields = (
            kind,
            random.randrange(256),
            random.randrange(256),
            random.randrange(4),
            random.choice((0, 0, 1, 2, 3)),
        )
        frame = wire.Header(0, seq, origin, destination, random.randrange(1, 0xFFFF), *fields).encode()
        frame += random.choice((wire.filler(40), random.randbytes(random.randrange(60))))
        match random.randrange(4):
            case 0:
                frame = frame[: random.randrange(len(frame))]
            case 1:
                turned = bytearray(frame)
                turned[random.randrange(len(frame))] ^= 1 << random.randrange(8)
                frame = bytes(turned)
        yield frame

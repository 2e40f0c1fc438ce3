"""Address resolution against RFC 826, RFC 1122 (2.3.2) and ns-3's ARP: timelines on a bench, before AODV's unicasts.

Node 1 is on the bench and has a long-lived route to node 9 over node 2, for which the test speaks.
"""

import struct
from collections.abc import Callable
from typing import Final

import pytest
from rival_bench import Bench

from fanet_mw.errors import ConfigError
from fanet_mw.routing import rival_control_messages as control
from fanet_mw.routing.address_resolution import (
    ALIVE_NS,
    DEAD_NS,
    MAX_RETRIES,
    PENDING,
    REQUEST_JITTER_NS,
    WAIT_REPLY_NS,
)
from fanet_mw.routing.aodv.messages import RREP, RREQ, UNKNOWN_SEQUENCE, RouteReply, RouteRequest
from fanet_mw.routing.hop_by_hop import ADDRESS_REPLY, ADDRESS_REQUEST
from fanet_mw.routing.rival_control_messages import Family, type_of
from fanet_mw.scenario import Scenario
from fanet_mw.units import BROADCAST, MS, S
from fanet_mw.wire import Kind

REQUEST: Final = type_of(Family.ADDRESS, ADDRESS_REQUEST)
REPLY: Final = type_of(Family.ADDRESS, ADDRESS_REPLY)
ANSWER: Final = type_of(Family.AODV, RREP)
ASK: Final = type_of(Family.AODV, RREQ)
RULES: Final = ("rfc826", "ns3")

MakeBench = Callable[..., Bench]


@pytest.fixture
def bench(make_scenario: Callable[..., Scenario]) -> MakeBench:
    def make(
        rules: str, nodes: int = 1, *, protocol: str = "aodv", links: list[tuple[int, int]] | None = None
    ) -> Bench:
        scenario = make_scenario(
            **{
                "routing.protocol": protocol,
                "routing.address_resolution": rules,
                "nodes.count": 100,
                "radio.lead_ms": 0,
                "traffic.arrivals": "none",
            }
        )
        return Bench(scenario, list(range(1, nodes + 1)), [(1, 2)] if links is None else links)

    return make


def routed(found: Bench, *, over: int = 2, destination: int = 9) -> Bench:
    """Node 1 is told of a route."""
    reply = RouteReply(0, destination, 20, 1, lifetime_ms=4_000_000)
    found.say(over, ANSWER, reply.encode(), to=1)
    return found


def target(node: int) -> bytes:
    return struct.pack("<H", node)


def asked(found: Bench, kind: int = REQUEST) -> list[tuple[int, int, int]]:
    """(instant, to whom the frame went, target) of the address messages of one kind."""
    controls = [(sent, *control.decode(sent.frame)) for sent in found.sent if sent.header.kind == Kind.ROUTING]
    return [(sent.t_ns, sent.dst, int.from_bytes(body, "little")) for sent, its, body in controls if its == kind]


def sent_to(found: Bench, node: int) -> list[int]:
    """Sequence numbers of the data packets that went to a next hop."""
    return [sent.header.seq for sent in found.sent if sent.header.kind == Kind.DATA and sent.dst == node]


@pytest.mark.parametrize("rules", RULES)
@pytest.mark.parametrize("protocol", ["aodv", "olsr", "dsdv", "geographic"])
def test_every_rival_that_goes_hop_by_hop_asks_before_its_first_unicast_and_still_delivers(
    bench: MakeBench, protocol: str, rules: str
) -> None:
    found = bench(rules, 3, protocol=protocol, links=[(1, 2), (2, 3)])
    found.advance(20 * S)
    wanted = found.send(1, 3)
    found.advance(15 * S)
    assert (3, 1, wanted) in [delivery[:3] for delivery in found.deliveries]
    assert {dst for _, dst, _ in asked(found)} == {BROADCAST}
    first = found.data(wanted, 1)[0]
    assert any(t_ns < first.t_ns and node == first.dst for t_ns, _, node in asked(found))
    before = len(asked(found))
    found.send(1, 3)
    found.advance(1 * S)
    assert len(asked(found)) == before, "everyone on the way is known now"


@pytest.mark.parametrize("rules", RULES)
def test_a_packet_waits_for_the_reply_and_goes_at_once_when_it_comes(bench: MakeBench, rules: str) -> None:
    found = routed(bench(rules))
    seq = found.send(1, 9)
    found.advance(REQUEST_JITTER_NS)
    assert [(dst, node) for _, dst, node in asked(found)] == [(BROADCAST, 2)]
    found.advance(500 * MS)
    assert sent_to(found, 2) == []
    assert found.protocol(1).waiting() == 1
    found.say(2, REPLY, target(1), to=1)
    found.advance(0)
    assert sent_to(found, 2) == [seq]
    found.advance(1 * S)
    assert found.protocol(1).waiting() == 0


@pytest.mark.parametrize("rules", RULES)
def test_a_request_is_repeated_every_second_three_times_and_then_what_waited_is_dropped(
    bench: MakeBench, rules: str
) -> None:
    found = routed(bench(rules))
    found.send(1, 9)
    found.advance((MAX_RETRIES + 1) * WAIT_REPLY_NS - 1)
    times = [t_ns for t_ns, _, _ in asked(found)]
    assert times[0] <= REQUEST_JITTER_NS
    assert times[1:] == [WAIT_REPLY_NS * n for n in range(1, MAX_RETRIES + 1)]
    assert found.nodes[1].dropped == {}
    found.advance(1)
    assert found.nodes[1].dropped == {"unresolved": 1}
    assert found.protocol(1).waiting() == 0
    found.advance(60 * S)
    assert len(asked(found)) == 1 + MAX_RETRIES


def test_rfc1122_the_latest_packets_wait_and_ns3_keeps_the_earliest(bench: MakeBench) -> None:
    for rules, kept in (("rfc826", slice(2, None)), ("ns3", slice(None, PENDING))):
        found = routed(bench(rules))
        wanted = [found.send(1, 9) for _ in range(PENDING + 2)]
        assert found.nodes[1].dropped == {"unresolved": 2}
        found.say(2, REPLY, target(1), to=1)
        found.advance(10 * MS)
        assert sent_to(found, 2) == wanted[kept]


def test_ns3_gives_a_neighbor_up_for_100_s_and_rfc826_asks_again_with_the_next_packet(bench: MakeBench) -> None:
    for rules, requests_after in (("rfc826", 1), ("ns3", 0)):
        found = routed(bench(rules))
        found.send(1, 9)
        found.advance((MAX_RETRIES + 1) * WAIT_REPLY_NS)
        before = len(asked(found))
        found.send(1, 9)
        found.advance(500 * MS)
        assert len(asked(found)) - before == requests_after
        assert found.nodes[1].dropped == {"unresolved": 2 - requests_after}
    found.advance(DEAD_NS)
    found.send(1, 9)
    found.advance(REQUEST_JITTER_NS)
    assert len(asked(found)) == before + 1, "a new attempt after the dead time"


@pytest.mark.parametrize("rules", RULES)
def test_an_address_is_known_for_two_minutes(bench: MakeBench, rules: str) -> None:
    found = routed(bench(rules))
    found.send(1, 9)
    found.say(2, REPLY, target(1), to=1)
    found.advance(ALIVE_NS)
    routed(found)
    found.send(1, 9)
    found.advance(20 * MS)
    assert (len(asked(found)), len(sent_to(found, 2))) == (1, 2)
    found.advance(1 * MS)
    found.send(1, 9)
    found.advance(20 * MS)
    assert (len(asked(found)), len(sent_to(found, 2))) == (2, 2)


@pytest.mark.parametrize("rules", RULES)
def test_who_is_asked_answers_who_asked_and_nobody_else_does(bench: MakeBench, rules: str) -> None:
    found = bench(rules)
    found.say(2, REQUEST, target(7), to=1)
    found.advance(10 * MS)
    assert asked(found, REPLY) == []
    found.say(2, REQUEST, target(1), to=1)
    found.advance(10 * MS)
    assert [(dst, node) for _, dst, node in asked(found, REPLY)] == [(2, 2)], "unicast, without asking for its address"


@pytest.mark.parametrize(("rules", "requests"), [("rfc826", 0), ("ns3", 1)])
def test_rfc826_who_is_asked_learns_who_asks_and_ns3_does_not(bench: MakeBench, rules: str, requests: int) -> None:
    found = routed(bench(rules))
    found.say(2, REQUEST, target(1), to=1)
    found.send(1, 9)
    found.advance(20 * MS)
    assert (len(asked(found)), len(sent_to(found, 2))) == (requests, 1 - requests)


@pytest.mark.parametrize(("rules", "gone"), [("rfc826", 1), ("ns3", 0)])
def test_rfc826_a_request_for_another_updates_its_sender_if_we_know_of_it(
    bench: MakeBench, rules: str, gone: int
) -> None:
    found = routed(bench(rules))
    found.send(1, 9)
    found.say(3, REQUEST, target(7), to=1)
    found.say(2, REQUEST, target(7), to=1)
    found.advance(10 * MS)
    assert len(sent_to(found, 2)) == gone
    routed(found, over=3, destination=8)
    found.send(1, 8)
    found.advance(20 * MS)
    assert sent_to(found, 3) == [], "node 3 was not known before, so its request for another teaches nothing"


def test_ns3_a_request_from_whom_we_have_asked_is_no_reply(bench: MakeBench) -> None:
    found = routed(bench("ns3"))
    seq = found.send(1, 9)
    found.say(2, REQUEST, target(1), to=1)
    found.advance(20 * MS)
    assert sent_to(found, 2) == []
    found.say(2, REPLY, target(1), to=1)
    found.advance(20 * MS)
    assert sent_to(found, 2) == [seq]


def test_ns3_a_reply_that_nobody_waits_for_teaches_nothing(bench: MakeBench) -> None:
    found = routed(bench("ns3"))
    found.say(2, REPLY, target(1), to=1)
    found.send(1, 9)
    found.advance(20 * MS)
    assert len(asked(found)) == 1
    found.say(2, REPLY, target(5), to=1)
    found.advance(20 * MS)
    assert sent_to(found, 2) == [], "a reply to somebody else"


@pytest.mark.parametrize(("rules", "second_ns"), [("rfc826", 1700 * MS), ("ns3", 1000 * MS)])
def test_ns3_has_one_timer_for_all_that_wait_and_rfc1122_asks_once_a_second(
    bench: MakeBench, rules: str, second_ns: int
) -> None:
    found = routed(routed(bench(rules)), over=3, destination=8)
    found.send(1, 9)
    found.advance(700 * MS)
    found.send(1, 8)
    found.advance(2 * S)
    assert [t_ns for t_ns, _, node in asked(found) if node == 3][1] == second_ns


@pytest.mark.parametrize("rules", RULES)
def test_unicast_control_waits_for_an_address_too(bench: MakeBench, rules: str) -> None:
    found = bench(rules)
    found.say(2, ASK, RouteRequest(UNKNOWN_SEQUENCE, 0, 1, 1, 0, 8, 5).encode(), to=1)
    found.advance(20 * MS)
    assert found.controls(RREP) == []
    assert [node for _, _, node in asked(found)] == [2]
    found.say(2, REPLY, target(1), to=1)
    found.advance(20 * MS)
    assert [(sent.dst, RouteReply.decode(body).originator) for sent, body in found.controls(RREP)] == [(2, 8)]


def test_a_packet_whose_custody_is_ours_is_carried_on_when_its_next_hop_does_not_answer(bench: MakeBench) -> None:
    found = bench("rfc826", 3, protocol="geographic", links=[(1, 2), (2, 3)])
    found.advance(3 * S)
    found.links.discard((2, 1))
    wanted = found.send(1, 3)
    found.advance((MAX_RETRIES + 2) * WAIT_REPLY_NS)
    assert found.data(wanted, 1) == []
    assert found.protocol(1).waiting() == 1
    found.links.add((2, 1))
    found.advance(5 * S)
    assert (3, 1, wanted) in [delivery[:3] for delivery in found.deliveries]


@pytest.mark.parametrize(
    ("kind", "body", "origin"),
    [(REQUEST, target(1), 5), (REQUEST, target(0), 2), (REQUEST, b"\x01", 2), (REPLY, target(1) + b"\x00", 2),
     (type_of(Family.ADDRESS, 3), target(1), 2)],
)  # fmt: skip
def test_what_makes_no_sense_is_counted_and_teaches_nothing(
    bench: MakeBench, kind: int, body: bytes, origin: int
) -> None:
    found = routed(bench("rfc826"))
    found.say(2, kind, body, to=1, origin=origin)
    assert found.nodes[1].dropped == {"malformed": 1}
    found.send(1, 9)
    found.advance(20 * MS)
    assert (len(asked(found)), asked(found, REPLY)) == (1, [])


def test_a_node_that_resolves_no_addresses_asks_nobody_and_answers_nobody(bench: MakeBench) -> None:
    found = routed(bench("none"))
    found.say(2, REQUEST, target(1), to=1)
    found.send(1, 9)
    found.advance(20 * MS)
    assert found.nodes[1].dropped == {"malformed": 1}
    assert (asked(found), asked(found, REPLY), len(sent_to(found, 2))) == ([], [], 1)


def test_a_protocol_without_next_hops_refuses_the_key(make_scenario: Callable[..., Scenario]) -> None:
    with pytest.raises(ConfigError, match=r"routing.address_resolution = ns3 needs .* not flooding"):
        make_scenario(**{"routing.protocol": "flooding", "routing.address_resolution": "ns3"})

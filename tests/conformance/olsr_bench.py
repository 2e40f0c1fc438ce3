"""OLSR nodes on a bench: what tests put on the air, and what they read from the air and from the nodes' state."""

from collections.abc import Callable

from rival_bench import Bench

from fanet_mw.routing.olsr.messages import HELLO, TC, Hello, HelloNeighbor, LinkType, NeighborType, encode_time
from fanet_mw.routing.rival_control_messages import Family, type_of
from fanet_mw.scenario import Scenario
from fanet_mw.units import NodeId, S

HELLO_TYPE, TC_TYPE = type_of(Family.OLSR, HELLO), type_of(Family.OLSR, TC)
LINE = [(1, 2), (2, 3), (3, 4), (4, 5)]
SIX_S, FIFTEEN_S = encode_time(6 * S), encode_time(15 * S)

MakeBench = Callable[..., Bench]


def benches(make_scenario: Callable[..., Scenario]) -> MakeBench:
    """Benches of OLSR nodes, in a line unless told otherwise."""

    def make(nodes: int = 5, links: list[tuple[int, int]] | None = None) -> Bench:
        scenario = make_scenario(
            **{"routing.protocol": "olsr", "nodes.count": 100, "radio.lead_ms": 0, "traffic.arrivals": "none"}
        )
        wanted = LINE if links is None else links
        return Bench(scenario, list(range(1, nodes + 1)), [link for link in wanted if max(link) <= nodes])

    return make


def hello(*heard: tuple[LinkType, NeighborType, int], willingness: int = 3, vtime: int = SIX_S) -> bytes:
    return Hello(vtime, encode_time(2 * S), willingness, tuple(HelloNeighbor(*entry) for entry in heard)).encode()


SEES_US = (LinkType.SYM, NeighborType.SYM, 1)
CHOSE_US = (LinkType.SYM, NeighborType.MPR, 1)
HEARS_US = (LinkType.ASYM, NeighborType.NOT, 1)


def with_neighbors(*nodes: int) -> list[tuple[LinkType, NeighborType, int]]:
    return [(LinkType.SYM, NeighborType.SYM, node) for node in nodes]


def own_hellos(found: Bench, node: int = 1, since_ns: int = 0) -> list[tuple[int, Hello]]:
    return [(s.t_ns, Hello.decode(body)) for s, body in found.controls(HELLO, node=node, since_ns=since_ns)]


def hops(found: Bench, node: int, destination: int) -> tuple[int, int] | None:
    route = found.protocol(node)._route(NodeId(destination), now_ns=found.now_ns)
    return None if route is None else (route.next_hop, route.hops)

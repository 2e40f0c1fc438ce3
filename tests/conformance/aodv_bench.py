"""AODV nodes on a bench: what tests put on the air, and what they read from the air and from the nodes' tables."""

from collections.abc import Callable

from rival_bench import Bench

from fanet_mw.routing.aodv.messages import RERR, RREP, RREQ, UNKNOWN_SEQUENCE, RouteError, RouteReply, RouteRequest
from fanet_mw.routing.aodv.table import AodvRoute
from fanet_mw.routing.rival_control_messages import Family, type_of
from fanet_mw.scenario import Scenario

ASK, ANSWER, ERROR = (type_of(Family.AODV, number) for number in (RREQ, RREP, RERR))
LINE = [(1, 2), (2, 3), (3, 4), (4, 5)]

MakeBench = Callable[..., Bench]


def benches(make_scenario: Callable[..., Scenario]) -> MakeBench:
    """Benches of AODV nodes, in a line unless told otherwise."""

    def make(nodes: int = 5, links: list[tuple[int, int]] | None = None, **keys: object) -> Bench:
        scenario = make_scenario(
            **{"routing.protocol": "aodv", "nodes.count": 100, "radio.lead_ms": 0, "traffic.arrivals": "none", **keys}
        )
        wanted = LINE if links is None else links
        return Bench(scenario, list(range(1, nodes + 1)), [link for link in wanted if max(link) <= nodes])

    return make


def requests(found: Bench, node: int | None = None, since_ns: int = 0) -> list[tuple[int, RouteRequest]]:
    """(TTL, RREQ) of those on the air."""
    return [
        (sent.header.hop_limit, RouteRequest.decode(body))
        for sent, body in found.controls(RREQ, node=node, since_ns=since_ns)
    ]


def replies(found: Bench, node: int | None = None, since_ns: int = 0) -> list[tuple[int, RouteReply]]:
    """(to whom, RREP) of those that are not hellos."""
    decoded = [(sent.dst, RouteReply.decode(b)) for sent, b in found.controls(RREP, node=node, since_ns=since_ns)]
    return [(dst, reply) for dst, reply in decoded if not reply.is_hello]


def hellos(found: Bench, node: int, since_ns: int = 0) -> list[int]:
    decoded = [(sent.t_ns, RouteReply.decode(b)) for sent, b in found.controls(RREP, node=node, since_ns=since_ns)]
    return [t_ns for t_ns, reply in decoded if reply.is_hello]


def errors(found: Bench, node: int | None = None) -> list[tuple[int, RouteError]]:
    return [(sent.dst, RouteError.decode(body)) for sent, body in found.controls(RERR, node=node)]


def route(found: Bench, node: int, destination: int) -> AodvRoute | None:
    return found.protocol(node)._table.entry(destination, now_ns=found.now_ns)


def active(found: Bench, node: int, destination: int) -> tuple[int, int] | None:
    """(next hop, hops)."""
    known = route(found, node, destination)
    return (known.next_hop, known.hops) if known is not None and known.active else None


def ask(**change: int) -> bytes:
    return RouteRequest(UNKNOWN_SEQUENCE, 0, 1, 9, 0, 8, 5)._replace(**change).encode()


def answer(**change: int) -> bytes:
    return RouteReply(0, 9, 20, 1, 5000)._replace(**change).encode()

"""What a plan's bounds assume, and what they cannot promise, as sentences."""

from collections.abc import Iterator, Sequence

from fanet_mw.protocol.delay import Outcome, Refused
from fanet_mw.protocol.planner.head import ClusterPlan
from fanet_mw.scenario import Scenario
from fanet_mw.units import S


def left_out(scenario: Scenario) -> Iterator[str]:
    if scenario.radio.channel != "range":
        yield "who hears whom is taken by distance, up to radio.range_m, whatever the channel does"
    if scenario.clusters.relay == "claimed":
        yield "slots are claimed in flight: this plan is of heads and contending relays, and says little of that"
    if scenario.clusters.repair_s > 0:
        yield "repairs of lost packets come later than any bound here, and their load is not counted"


def assumed(access: Outcome, clusters: Sequence[ClusterPlan], *, guard_ns: int, uplink_ns: int) -> Iterator[str]:
    if isinstance(access, Refused):
        yield f"the way to the head is assumed to take at most {uplink_ns / S:g} s, not proven: {access.reason}"
    if any(not cluster.flood.proven for cluster in clusters):
        yield "floods are relayed by CSMA/CA: their duration and spacing are estimates, and losses are not counted"
        tail_ns = max(cluster.flood.duration_ns - cluster.flood.spacing_ns for cluster in clusters)
        if tail_ns > guard_ns:
            yield (
                f"a slot's last flood runs about {tail_ns / 1e6:.0f} ms into the next slot, the guard time is "
                f"{guard_ns / 1e6:g} ms: floods of neighboring slots meet"
            )
    else:
        yield "floods hold their bound while no frame is lost and the nodes are where the timetable has them"

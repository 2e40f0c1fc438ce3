"""Clocks of one seed agree on the same times in every release: nodes of two releases are in one swarm."""

from collections.abc import Iterator
from typing import Any

import pytest
from kept_values import kept
from time_network import Network, connected, line

from fanet_mw.scenario import Clock
from fanet_mw.units import NodeId, S

CLOCKS = {
    "good": Clock(sync="beacons", offset_ms=500, drift_ppm=20),
    "wandering": Clock(sync="beacons", offset_ms=3, drift_ppm=40, wander_ppm=0.5),
}


@pytest.mark.parametrize("name", CLOCKS)
@pytest.mark.parametrize("lost", [None, 1, 3])
def test_times_are_what_they_were_before(name: str, lost: int | None) -> None:
    def values() -> Iterator[Any]:
        for seed, links in enumerate((line(6), connected(9, 4, 2))):
            network = Network(links, CLOCKS[name], seed=seed, loss=0.15)
            for second in range(5, 90, 5):
                network.run(second)
                if second == 30 and lost:
                    network.members[lost].alive = False
                if second == 60 and lost:
                    network.members[lost].alive = True
                    network.deliver(2, 5, 9000, None, network.now_ns)
                    network.members[2].sync.on_old_hello(NodeId(4), network.members[2].clock.local_ns(network.now_ns))
                yield network.errors()
                for member in network.members.values():
                    local_ns = member.clock.local_ns(second * S)
                    sync = member.sync
                    yield (
                        sync.reference,
                        sync.synced,
                        sync.hops(local_ns),
                        sync.counts,
                        sync.line,
                        sync.beacon(local_ns),
                    )

    kept(f"times, {name}, without {lost}", values())

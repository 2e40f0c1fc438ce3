"""The connectivity that geometry allows: which nodes have a multi-hop path, on the ideal track of the mobility model.

No protocol that delivers packets at once can exceed it; one that carries packets for a while can.
"""

import numpy as np
import numpy.typing as npt

from agents.applications.traffic import sources_of, targets_of
from fanet_mw.scenario.model import Scenario
from fanet_mw.units import S
from sim.results.links_over_time import within
from sim.world.environment.layout import positions
from sim.world.mobility.guidance import Guidance


def parts(linked: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """The number of the connected component of each node; `linked` holds for a node and itself, too."""
    part = np.arange(len(linked))
    while True:
        lower = np.where(linked, part[None], len(linked)).min(axis=1, initial=len(linked))
        if (lower == part).all():
            return part
        part = lower


def connectivity(scenario: Scenario) -> float:
    """The share of (source, target, second of the measured window) with a multi-hop path of `radio.range_m` links."""
    guidance = Guidance(np.array(positions(scenario)[: scenario.nodes.count], dtype=np.float64), scenario)
    first_ns, end_ns = scenario.traffic_window_ns
    pairs = [(source, target) for source in sources_of(scenario) for target in targets_of(scenario, source)]
    if not pairs:
        return 0.0
    sources, targets = np.array(pairs).T - 1
    shares = []
    for t_s in range(first_ns // S, max(end_ns // S, first_ns // S + 1)):
        at = guidance.track(float(t_s)).places
        part = parts(within(at, scenario.radio.range_m))
        shares.append(float((part[sources] == part[targets]).mean()))
    return float(np.mean(shares))

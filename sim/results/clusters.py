"""How well clusters follow the network: the roles in the trace on the links of each second of the measured window.

`summary_figures.toml` defines the figures. A node that stands in for a head that is gone is the head. Empty for
protocols without clusters.
"""

import statistics
from collections import defaultdict
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from fanet_mw.trace import RoleChanged
from fanet_mw.units import S
from sim.records.record_kinds import records_of
from sim.results.links_over_time import LinksOverTime, parts
from sim.results.outcome import Outcome
from sim.world.arrays import Flags

_FAR: Final = 4


def clusters(outcome: Outcome, links: LinksOverTime) -> dict[str, Any]:
    first_ns, end_ns = outcome.scenario.traffic_window_ns
    end_ns = min(end_ns, outcome.simulated_ns)
    head_of: dict[int, int] = {}
    changes = 0
    torn: list[bool] = []
    hops: list[float] = []
    sizes: list[int] = []
    second = -(-first_ns // S)

    def look(until_ns: int) -> None:
        nonlocal second
        while second * S < min(until_ns, end_ns):
            apart = _Hops(links.at(second))
            members = defaultdict(list)
            for node, head in head_of.items():
                if head:
                    members[head].append(node - 1)
            for head, nodes in members.items():
                torn.append(len(set(parts(links.at(second)[np.ix_(nodes, nodes)]).tolist())) > 1)
                sizes.append(len(nodes))
                hops.extend(apart.to(head - 1)[node] for node in nodes if node != head - 1)
            second += 1

    for record in records_of(outcome.records, RoleChanged):
        look(record.t_ns)
        changes += record.node in head_of and first_ns <= record.t_ns < end_ns
        head_of[record.node] = record.head
    look(end_ns)
    if not sizes:
        return {}
    minutes = (end_ns - first_ns) / S / 60 * outcome.scenario.nodes.count
    return {
        "torn": round(statistics.fmean(torn), 6),
        "hops_to_head": _spread(hops),
        "role_changes": round(changes / minutes, 3),
        "sizes": {"least": min(sizes), "p50": statistics.median(sizes), "most": max(sizes)},
    }


def _spread(hops: list[float]) -> dict[str, float | None]:
    """Mean and 95th percentile of those with a way; the share of those that are far or have none."""
    if not hops:
        return {"mean": None, "p95": None, "far": None}
    known = np.array([each for each in hops if np.isfinite(each)])
    return {
        "mean": round(float(known.mean()), 3) if len(known) else None,
        "p95": float(np.quantile(known, 0.95, method="higher")) if len(known) else None,
        "far": round(float(np.mean(np.array(hops) > _FAR)), 6),
    }


class _Hops:
    """Hops over the links of an instant."""

    def __init__(self, links: Flags) -> None:
        self._links = links
        self._found: dict[int, npt.NDArray[np.float64]] = {}

    def to(self, node: int) -> npt.NDArray[np.float64]:
        """The hops of each node to this one; infinite where there is no way."""
        if node not in self._found:
            hops = np.full(len(self._links), np.inf)
            ring, count = np.zeros(len(hops), bool), 0
            ring[node] = True
            while ring.any():
                hops[ring] = count
                ring, count = self._links[ring].any(axis=0) & np.isinf(hops), count + 1
            self._found[node] = hops
        return self._found[node]

"""How near UAVs truly come to each other: what collision warnings are to be judged by.

Between two steps of the engine bodies are taken to fly straight, so nothing passes between them unseen.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fanet_mw.trace import ConflictForeseen, Delivered, Warned
from fanet_mw.units import MS
from sim.run.outcome import Outcome
from sim.world.engines.contract import Rows


class Separation:
    """The least distance of any two, and how often two came nearer than they should."""

    def __init__(self, distance_m: float) -> None:
        self._distance_m = distance_m
        self._least_m: float | None = None
        self._near: frozenset[tuple[int, int]] = frozenset()
        self._losses = 0

    def watch(self, before: Rows, after: Rows) -> None:
        """One step, positions [nodes, 3] in m. Pairs that stay near count once."""
        if len(before) < 2:
            return
        first, second = np.triu_indices(len(before), k=1)
        apart = before[first] - before[second]
        change = after[first] - after[second] - apart
        moved2 = np.maximum((change**2).sum(axis=1), 1e-12)
        share = np.clip(-(apart * change).sum(axis=1) / moved2, 0.0, 1.0)
        distance = np.linalg.norm(apart + change * share[:, None], axis=1)
        least = float(distance.min())
        self._least_m = least if self._least_m is None else min(self._least_m, least)
        rows = np.flatnonzero(distance < self._distance_m).tolist()
        near = frozenset((int(first[row]), int(second[row])) for row in rows)
        self._losses += len(near - self._near)
        self._near = near

    def report(self) -> Mapping[str, Any]:
        """`least_m` is None while nothing has moved."""
        return {"least_m": None if self._least_m is None else round(self._least_m, 2), "losses": self._losses}


def separation(outcome: Outcome) -> dict[str, Any]:
    """`separation` of `summary.json`: what the world saw, and what the UAVs foresaw; empty when nobody looked."""
    seen = outcome.reports.get("world", {}).get("separation")
    if not seen:
        return {}
    foreseen = [r for r in outcome.records if type(r) is ConflictForeseen]
    about = {(r.node, r.seq): r.other for r in outcome.records if type(r) is Warned}
    delays_ms = [
        r.delay_ns / MS for r in outcome.records if type(r) is Delivered and about.get((r.origin, r.seq)) == r.node
    ]
    ahead_s = sorted(r.closest_ms / 1000 for r in foreseen)
    return {
        **seen,
        "foreseen": len(foreseen),
        "told": sum(r.told for r in foreseen),
        "ahead_s": {"least": ahead_s[0], "p50": ahead_s[len(ahead_s) // 2]} if ahead_s else {},
        "warnings": len(about),
        "reached_the_other": round(len(delays_ms) / len(about), 6) if about else None,
        "to_the_other_ms": {
            "p50": round(float(np.percentile(delays_ms, 50)), 3),
            "p95": round(float(np.percentile(delays_ms, 95)), 3),
            "max": round(max(delays_ms), 3),
        } if delays_ms else {},
    }  # fmt: skip

"""How a planned search fares over other protocols, over a network that loses frames, and over none."""

import itertools
import statistics
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final

from fanet_mw.scenario import Scenario
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios.catalog import find
from tests.tables.markdown import Rows

_SEEDS: Final = (1,)
_SMALL: Final = (
    "nodes.count=12", "nodes.spacing_m=100", "nodes.telemetry_hz=0", "world.area_m=500", "mission.survivors=6",
    "duration_s=80",
)  # fmt: skip
"""A search that takes seconds of CPU, with an area of a twenty-fifth of that of `rescue`."""
_PROTOCOLS: Final = {
    "plain flooding": ("routing.protocol=flooding",),
    "the paper's protocol": (
        "clusters.count=4", "clusters.flooding_period_s=5", "clusters.relay=all", "clusters.pacing=burst",
        "clusters.repair_s=0",
    ),
    "ours, as `rescue` has it": (),
}  # fmt: skip
_LOSSES: Final = (0.0, 0.5, 0.8)
_OFF: Final = 1.0
_CASES: Final = (
    *((name, keys, loss) for name, keys in _PROTOCOLS.items() for loss in _LOSSES),
    ("none: the network is off", (), _OFF),
    ("ours, and hellos are not used to avoid others", ("mission.avoid_by=[]",), 0.0),
)


def over_networks() -> Rows:
    """Scenario `rescue` in small: every link loses a share of the frames that would have been received."""
    rows = [
        [
            "protocol", "frames lost", "confirmed of 6", "mistaken", "half confirmed after [s]", "reports delivered",
            "area covered", "connected", "contacts", "nearest UAV: least / 1 % / median [m]",
        ]
    ]  # fmt: skip
    for name, keys, loss in _CASES:
        found = [_mission(keys, loss, seed) for seed in _SEEDS]
        rows.append([name, f"{loss:.0%}", *_cells(found)])
    return rows


def _cells(found: Sequence[Mapping[str, Any]]) -> Sequence[str]:
    """What several seeds came to, on average; of the distances, over all."""
    half_s = [one["half_s"] for one in found if one["half_s"] is not None]

    def mean(key: str) -> float:
        return statistics.fmean(one[key] for one in found)

    return [
        f"{mean('confirmed'):.1f}",
        f"{mean('mistaken'):.1f}",
        f"{statistics.fmean(half_s):.0f}" if len(half_s) == len(found) else "never in some seeds",
        f"{mean('reports'):.2f}",
        f"{mean('coverage'):.2f}",
        f"{mean('connected'):.2f}",
        f"{sum(one['collisions'] for one in found)}",
        f"{min(one['least'] for one in found):.1f} / {mean('p1'):.0f} / {mean('p50'):.0f}",
    ]


def degraded(scenario: Scenario, loss: float) -> Scenario:
    """The scenario with a share of the frames lost on every link, from the beginning to the end."""
    pairs = itertools.combinations(scenario.node_ids, 2)
    faults = [{"kind": "degrade", "at_s": 0, "src": a, "dst": b, "loss_share": loss} for a, b in pairs] if loss else []
    return Scenario.model_validate({**scenario.model_dump(), "faults": faults})


@cache
def _mission(keys: tuple[str, ...], loss: float, seed: int) -> Mapping[str, Any]:
    summary = finish(simulate(degraded(find("rescue", [*_SMALL, *keys, f"seed={seed}"]), loss)), out=None)
    mission, times = summary["mission"], summary["mission"]["time_to_confirm_s"]
    half = mission["survivors"] // 2
    return {
        **mission,
        **mission["nearest_m"],
        "half_s": times[half - 1] if len(times) >= half else None,
        "reports": summary["reports"]["pdr"],
    }

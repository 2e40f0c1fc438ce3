"""How a planned search fares over other protocols, over a network that loses frames, and over none."""

import statistics
from collections.abc import Mapping, Sequence
from typing import Final

from tests.tables.kept import Kept, Run
from tests.tables.markdown import Rows
from tests.tables.missions import Case, all_flown, flown

_FEW_UAVS: Final = (
    "nodes.count=12", "nodes.spacing_m=100", "nodes.telemetry_hz=0", "world.area_m=500", "mission.survivors=6",
    "duration_s=80",
)  # fmt: skip
"""A search that takes seconds of CPU, with an area of a twenty-fifth of that of `rescue`."""
_PROTOCOLS: Final = {
    "ours, as `rescue` has it": (),
    "plain flooding": ("routing.protocol=flooding",),
    "the paper's protocol": (
        "clusters.count=4", "clusters.flooding_period_s=5", "clusters.relay=all", "clusters.pacing=burst",
        "clusters.repair_s=0",
    ),
}  # fmt: skip
_FIRST_SEEDS: Final = tuple(range(1, 6))


def _cases(keys: tuple[str, ...], seeds: tuple[int, ...], losses: tuple[float, ...]) -> Mapping[str, Case]:
    return {
        f"{name} | {loss:.0%}": Case("rescue", (*keys, *protocol), seeds, loss)
        for loss in losses
        for name, protocol in _PROTOCOLS.items()
    } | {"none: the network is off | 100%": Case("rescue", keys, seeds, 1.0)}


SMALL: Final = {
    **_cases(_FEW_UAVS, _FIRST_SEEDS, (0.0, 0.5, 0.8)),
    "ours, and hellos are not used to avoid others | 0%": Case(
        "rescue", (*_FEW_UAVS, "mission.avoid_by=[]"), _FIRST_SEEDS
    ),
}


def over_networks(kept: Kept | None = None) -> Rows:
    """Scenario `rescue` in small."""
    return _table(SMALL, all_flown(SMALL, kept))


def _table(cases: Mapping[str, Case], kept: Kept) -> Rows:
    head = [
        "protocol", "frames lost", "seeds", "confirmed", "mistaken", "half confirmed after [s]", "last find [s]",
        "reports delivered", "area covered", "95 % covered after [s]", "connected", "contacts",
        "nearest UAV: least / 1 % / median [m]",
    ]  # fmt: skip
    return [head, *([*name.split(" | "), *_cells(flown(case, kept))] for name, case in cases.items())]


def _cells(runs: Sequence[Run]) -> Sequence[str]:
    """What several seeds came to, on average; of contacts and the least distance, over all."""

    def mean(key: str) -> float:
        return statistics.fmean(run[key] for run in runs)

    def instant(found: Sequence[float | None]) -> str:
        known = [instant_s for instant_s in found if instant_s is not None]
        return f"{statistics.fmean(known):.0f}" if len(known) == len(found) else "not in each"

    times_s = [run["time_to_confirm_s"] for run in runs]
    half = [run["survivors"] // 2 for run in runs]
    return [
        f"{len(runs)}",
        f"{sum(run['confirmed'] for run in runs)} of {sum(run['survivors'] for run in runs)}",
        f"{sum(run['mistaken'] for run in runs)}",
        instant([found[at - 1] if len(found) >= at else None for found, at in zip(times_s, half, strict=True)]),
        instant([max(found, default=None) for found in times_s]),
        f"{statistics.fmean(run['reports'] or 0.0 for run in runs):.2f}",
        f"{mean('coverage'):.2f}",
        instant([run["covered_95_s"] for run in runs]),
        f"{mean('connected'):.2f}",
        f"{sum(run['collisions'] for run in runs)}",
        f"{min(run['nearest_m']['least'] for run in runs):.1f} / "
        f"{statistics.fmean(run['nearest_m']['p1'] for run in runs):.0f} / "
        f"{statistics.fmean(run['nearest_m']['p50'] for run in runs):.0f}",
    ]

"""The rescue of the paper's tables 1 and 2 as `rescue-paper` flies it: when UAVs turn towards survivors.

Figure 12 of the pages on the paper compares networks, by variants of this scenario. This table is of the scenario as it
is, and says what else a mission comes to.
"""

import statistics
from collections.abc import Mapping, Sequence
from typing import Final

from tests.tables.kept import Kept, Run, codes
from tests.tables.markdown import Rows
from tests.tables.missions import Case, all_flown, flown

PAPER: Final[Mapping[str, Case]] = {
    interval_s: Case("rescue-paper", (f"mission.report_interval_s={interval_s}",), tuple(range(1, 6)))
    for interval_s in ("1.0", "0.5", "0.1")
}
"""By the interval of app_2 [s]."""
_HEAD: Final = [
    "app_2 every [s]", "seeds", "anybody turns in", "UAVs that turn, of 45", "half have turned after [s]",
    "since three UAVs had heard one phone [s]", "app_2 delivered", "app_1 delivered", "connected [%]", "contacts",
    "code",
]  # fmt: skip


def paper_rescues(kept: Kept | None = None) -> Rows:
    """The missions of all seeds, for each interval of app_2."""
    kept = all_flown(PAPER, kept)
    return [_HEAD, *(paper_row(interval_s, flown(case, kept)) for interval_s, case in PAPER.items())]


def paper_row(interval_s: str, runs: Sequence[Run]) -> list[str]:
    """One line of the table. Where nobody turns, no time is counted."""
    turned = [run for run in runs if run["half_approached_s"] is not None]
    return [
        interval_s,
        f"{len(runs)}",
        f"{sum(run['uavs_approaching'] > 0 for run in runs)}",
        _spread([run["uavs_approaching"] for run in runs], 0),
        _spread([run["half_approached_s"] for run in turned], 0),
        _spread([run["half_approached_s"] - run["enough_heard_s"] for run in turned], 2),
        _spread([run["reports"] for run in runs if run["reports"] is not None], 2),
        _spread([run["pdr"] for run in runs], 2),
        _spread([100 * run["connected"] for run in runs], 0),
        f"{sum(run['collisions'] for run in runs)}",
        codes(runs),
    ]


def _spread(values: Sequence[float], digits: int) -> str:
    """The median, and the least and the greatest value."""
    if not values:
        return "-"
    return f"{statistics.median(values):.{digits}f} [{min(values):.{digits}f}, {max(values):.{digits}f}]"

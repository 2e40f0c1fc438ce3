"""Measured tables of planned searches: in difficult places, and how near UAVs come to each other.

A mission costs a minute of CPU or more, so those that were flown are kept (`kept.py`) and the tables made of them.
`python -m tests.tables.pieces --seconds 600 places` flies as many that are still missing as fit into ten minutes; no
table is written before all of its missions are there.
"""

import statistics
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from agents.mission.searcher import formation, least_nodes
from fanet_mw.scenario import Scenario
from fanet_mw.trace import Approaching, Collided, Confirmed, Detected, FlightModeChanged, Posed, Record
from fanet_mw.units import S
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog
from sim.world.environment.survivors import Survivors
from tests.tables.kept import KEPT, Kept, Missing, Run, codes
from tests.tables.markdown import Rows

_NEAR_M: Final = (10.0, 20.0, 50.0)

_OF_THE_SUMMARY: Final = (
    "survivors", "detected", "confirmed", "mistaken", "reopened", "time_to_confirm_s", "confirmed_error_m",
    "uavs_approaching", "collisions", "coverage", "covered_95_s", "connected", "nearest_m", "wait_s", "biconnected",
    "diameter", "persons",
)  # fmt: skip
"""What tables read of the summary's table `mission`."""


class Case(NamedTuple):
    """A scenario with some keys, and the seeds with which it is measured."""

    scenario: str
    settings: tuple[str, ...]
    seeds: tuple[int, ...]

    def missing(self, kept: Kept) -> list[int]:
        """The seeds of which no mission is kept."""
        return [seed for seed in self.seeds if self.with_seed(seed) not in kept]

    def flown(self, kept: Kept, seed: int) -> Run:
        """What the mission with this seed came to."""
        return kept.of(self.with_seed(seed), self.settings)

    def with_seed(self, seed: int) -> Scenario:
        return catalog.find(self.scenario, [*self.settings, f"seed={seed}"])


_TEN: Final = tuple(range(1, 11))
_TOWN: Final = Case("town", ("mission.search=lines",), (1, 2))
_RING: Final = Case("town", (), (1, 2))
PLACES: Final[Mapping[str, Case]] = {"`town`": _RING, "`town`, in lines": _TOWN}
_SMALL: Final = (
    "nodes.count=20", "nodes.spacing_m=100", "nodes.telemetry_hz=0", "clusters.count=4", "traffic.interval_s=4",
    "world.area_m=1000", "mission.survivors=8", "duration_s=150",
)  # fmt: skip
"""`rescue` over a sixth of its area."""
COUNTRY_IN_SMALL: Final[Mapping[str, Case]] = {
    "`rescue`": Case("rescue", _SMALL, _TEN),
    "`hills`": Case("hills", _SMALL, _TEN),
    "`night`, without GPS within 240 m from 30 to 110 s": Case(
        "night", (*_SMALL, "sensors.gps_outages=[[0,0,240,30,110]]"), _TEN
    ),
}
_NO_LEADS: Final = ("radio.lead_ms=0", "radio.handover_ms=0", "duration_s=300")
_FIVE: Final = tuple(range(1, 6))
_AS_SHIPPED: Final = ("hills", "night", "rescue-base", "convoy", "crossing", "town")
WHOLE: Final[Mapping[str, Case]] = {
    "`rescue`, no leads": Case("rescue", _NO_LEADS, tuple(range(12, 32))),
    **{f"`{name}`": Case(name, (), _FIVE) for name in _AS_SHIPPED},
    "`town`": Case("town", (), tuple(range(1, 21))),
    "`town`, in lines": _TOWN,
}
"""Missions as they are shipped, which cost minutes of CPU each."""
SHAPES: Final[Mapping[str, Case]] = {
    **{f"`{shape}`, 20 UAVs": Case("rescue", (*_SMALL, f"mission.search={shape}"), ())
       for shape in ("lines", "spiral", "sectors")},
    "`spiral`, 6 UAVs": Case("rescue", (
        *_SMALL, "mission.search=spiral", "nodes.count=6", "clusters.count=1", "traffic.sources=5", "duration_s=550",
    ), ()),
}  # fmt: skip
CLEAR: Final[Mapping[str, Case]] = {
    "`town`: hellos of neighbors and radar": _RING,
    "`town`, in lines: the same": _TOWN,
    "`rescue` in small: hellos of neighbors": Case("rescue", _SMALL, _TEN),
}


def fly(scenario: Scenario) -> Run:
    """What one mission comes to."""
    began_s = time.process_time()
    outcome = simulate(scenario)
    records = outcome.records
    summary = finish(outcome, out=None)
    nearest = np.concatenate(list(_nearest_m(records)))
    return {
        **of_summary(summary),
        **_under_rubble(scenario, records),
        "solid": sum(1 for record in records if type(record) is Collided and not record.other),
        "least_charge": outcome.reports["world"].get("least_charge"),
        "near": [float((nearest <= limit).mean()) for limit in _NEAR_M],
        "landed": len({r.node for r in records if type(r) is FlightModeChanged and r.mode == "land"}),
        "fell": len({r.node for r in records if type(r) is FlightModeChanged and r.mode == "fallen"}),
        "cpu_s": time.process_time() - began_s,
    }


def of_summary(summary: Run) -> Run:
    """Those figures that tables read of the summary of a mission."""
    mission, reports = summary["mission"], summary.get("reports", {})
    bound = summary["bound"].get("classes", {}).get("report", {})
    return {
        **{name: mission[name] for name in _OF_THE_SUMMARY},
        "pdr": summary["pdr"],
        "bulk_ms": summary["delay_ms"],
        "reports": reports.get("pdr"),
        "reports_ms": reports.get("delay_ms"),
        "stated": bound.get("stated_share"),
        "broken": summary["bound"].get("violations", 0),
        "no_fly": summary["no_fly_entries"],
        "least_m": summary["separation"].get("least_m"),
        "losses": summary["separation"].get("losses"),
        "simulated_s": summary["simulated_s"],
    }


def flown(case: Case, kept: Kept) -> list[Run]:
    """What the missions of a case came to, seed by seed."""
    return [case.flown(kept, seed) for seed in case.seeds]


def all_flown(cases: Mapping[str, Case], kept: Kept | None = None) -> Kept:
    """The kept missions of a table. Raises Missing, with the seeds by case, if not all of them were flown."""
    kept = kept or Kept(KEPT)
    missing = {name: case.missing(kept) for name, case in cases.items()}
    if any(missing.values()):
        raise Missing([f"{name}: seeds {seeds}" for name, seeds in missing.items() if seeds])
    return kept


def _under_rubble(scenario: Scenario, records: Collection[Record]) -> Run:
    """How many survivors are buried, how many of them were found, and how far off the last known estimates are."""
    survivors = Survivors(scenario)
    buried = {int(row) + 1 for row in np.flatnonzero(survivors.buried)}
    last = {record.survivor: record for record in records if type(record) is Approaching and record.survivor in buried}
    return {
        "buried": len(buried),
        "buried_detected": len({r.survivor for r in records if type(r) is Detected} & buried),
        "buried_confirmed": len({r.survivor for r in records if type(r) is Confirmed} & buried),
        "buried_off_m": [
            float(np.hypot(*(survivors.places[survivor - 1][:2] - (record.east_m, record.north_m))))
            for survivor, record in sorted(last.items())
        ],
    }


def _nearest_m(records: Collection[Record]) -> Iterator[np.ndarray]:
    """Second by second, how far each flying UAV is from the one nearest to it."""
    instants: dict[int, list[tuple[float, float, float]]] = {}
    for record in records:
        if type(record) is Posed and record.up_m > 1.0:
            instants.setdefault(record.t_ns // S, []).append((record.east_m, record.north_m, record.up_m))
    for places in instants.values():
        at = np.array(places)
        apart = np.linalg.norm(at[:, None] - at[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        yield apart.min(axis=1)


def places_row(name: str, runs: Sequence[Run]) -> list[str]:
    """One line of the table of places."""
    covered = [found["covered_95_s"] for found in runs if found["covered_95_s"] is not None]
    errors = [found["confirmed_error_m"] for found in runs if found["confirmed_error_m"] is not None]
    last = [max(found["time_to_confirm_s"], default=0.0) for found in runs]
    return [
        name,
        str(len(runs)),
        f"{sum(found['confirmed'] == found['survivors'] for found in runs)}",
        f"{sum(found['confirmed'] for found in runs)} of {sum(found['survivors'] for found in runs)}",
        f"{sum(found['mistaken'] for found in runs)}",
        f"{statistics.median(last):.0f}",
        f"{statistics.median(errors):.1f}",
        f"{statistics.median(covered):.0f}" if covered else "-",
        f"{100 * min(found['connected'] for found in runs):.1f}",
        f"{sum(found['collisions'] - found['solid'] for found in runs)} / {sum(found['solid'] for found in runs)}",
        f"{sum(found['no_fly'] for found in runs)}",
        f"{sum(found['landed'] for found in runs)} / {sum(found['fell'] for found in runs)}",
        codes(runs),
    ]


PLACES_HEAD: Final = [
    "scenario", "seeds", "everyone confirmed in", "confirmed", "mistaken", "last find [s], median", "error [m], median",
    "95 % covered after [s]", "connected, least [%]", "contacts with UAVs / solids", "no-fly areas entered",
    "landed early / fell", "code",
]  # fmt: skip
WHOLE_HEAD: Final = [
    "scenario", "seeds", "found (by phone)", "last phone named [s]", "error [m]", "wait: median / worst [s]",
    "95 % covered after [s]", "contacts", "least distance [m]", "connected, least [%]",
    "reports: half / 95 % / worst [s]", "bounds of reports stated, least / broken", "bulk: PDR, least / 95 % [s]",
    "code",
]  # fmt: skip
CLEAR_HEAD: Final = [
    "others are known by", "seeds", "contacts with UAVs / solids", "nearer than 4 m", "least distance [m]",
    "nearest UAV: 1 % / median [m]",
    *(f"UAV-seconds within {limit:.0f} m [%]" for limit in _NEAR_M),
    "code",
]  # fmt: skip


def clear_row(name: str, runs: Sequence[Run]) -> list[str]:
    """One line of the table of distances.

    Where the world watches no distances (`mission.collision_distance_m`), the least one is that at whole seconds, and
    nobody counts how often UAVs were nearer than that.
    """
    watched = all(found["losses"] is not None for found in runs)
    least_m = [found["least_m"] if watched else found["nearest_m"]["least"] for found in runs]
    near = np.mean([found["near"] for found in runs], axis=0)
    return [
        name,
        str(len(runs)),
        f"{sum(found['collisions'] - found['solid'] for found in runs)} / {sum(found['solid'] for found in runs)}",
        f"{sum(found['losses'] for found in runs)}" if watched else "-",
        f"{min(least_m):.1f}",
        f"{statistics.fmean(found['nearest_m']['p1'] for found in runs):.0f} / "
        f"{statistics.fmean(found['nearest_m']['p50'] for found in runs):.0f}",
        *(f"{100 * share:.2f}" for share in near),
        codes(runs),
    ]


def places(kept: Kept | None = None) -> Rows:
    """Searches in a town."""
    kept = all_flown(PLACES, kept)
    return [PLACES_HEAD, *(places_row(name, flown(case, kept)) for name, case in PLACES.items())]


def country_in_small(kept: Kept | None = None) -> Rows:
    """A square kilometre with 20 UAVs: over a plain, over hills, and with an outage of GPS."""
    kept = all_flown(COUNTRY_IN_SMALL, kept)
    return [PLACES_HEAD, *(places_row(name, flown(case, kept)) for name, case in COUNTRY_IN_SMALL.items())]


def whole(kept: Kept | None = None) -> Rows:
    """The shipped missions in full size: what they find, and what their network does."""
    kept = all_flown(WHOLE, kept)
    return [WHOLE_HEAD, *(whole_row(name, flown(case, kept)) for name, case in WHOLE.items())]


def whole_row(name: str, runs: Sequence[Run]) -> list[str]:
    """One line of the table of whole missions: medians over the seeds, and the worst of any."""

    def median(values: Sequence[float | None], digits: int = 0) -> str:
        known = [value for value in values if value is not None]
        return f"{statistics.median(known):.{digits}f}" if known else "-"

    def seconds(name: str, part: str) -> list[float | None]:
        told = [(run[name] or {}).get(part) for run in runs]
        return [None if ms is None else ms / 1000 for ms in told]

    def worst(values: Sequence[float | None], digits: int) -> str:
        return f"{max(value for value in values if value is not None):.{digits}f}" if any(values) else "-"

    found = sum(run.get("persons", run["confirmed"]) for run in runs)  # older rows have no persons
    finds, stated = any(run["survivors"] for run in runs), [run["stated"] for run in runs if run["stated"] is not None]
    return [
        name,
        str(len(runs)),
        f"{found} of {sum(run['survivors'] for run in runs)} ({sum(run['confirmed'] for run in runs)})"
        if finds
        else "-",
        median([max(run["time_to_confirm_s"], default=None) for run in runs]),
        median([run["confirmed_error_m"] for run in runs], 1),
        f"{median([run['wait_s']['p50'] for run in runs])} / {worst([run['wait_s']['max'] for run in runs], 0)}",
        median([run["covered_95_s"] for run in runs]),
        f"{sum(run['collisions'] for run in runs)}",
        f"{min(run['nearest_m']['least'] for run in runs):.1f}",
        f"{100 * min(run['connected'] for run in runs):.1f}",
        f"{median(seconds('reports_ms', 'p50'), 2)} / {median(seconds('reports_ms', 'p95'), 2)} / "
        f"{worst(seconds('reports_ms', 'max'), 2)}",
        f"{min(stated):.3f} / {sum(run['broken'] for run in runs)}" if stated else "-",
        f"{min(run['pdr'] for run in runs):.3f} / {median(seconds('bulk_ms', 'p95'), 2)}",
        codes(runs),
    ]


def shapes() -> Rows:
    """What the formations of all shapes are over the same square kilometre."""
    head = ["search, UAVs", "fewest UAVs", "teams x lanes + relays + followers", "a sweep [s]"]
    return [head, *(shapes_row(name, case.with_seed(1)) for name, case in SHAPES.items())]


def shapes_row(name: str, scenario: Scenario) -> list[str]:
    """One line of the table of shapes."""
    pattern = formation(scenario, scenario.nodes.count)
    assert pattern is not None, "the catalog refuses searches without a formation"
    made = pattern.dimensions
    return [
        name,
        str(least_nodes(scenario)),
        f"{made.teams} x {made.lanes} + {made.relays} + {made.followers}",
        f"{pattern.shape.sweep_s:.0f}",
    ]


def keeping_clear(kept: Kept | None = None) -> Rows:
    """How near UAVs come to each other in a town, and over open ground, where no UAV has a radar."""
    kept = all_flown(CLEAR, kept)
    return [CLEAR_HEAD, *(clear_row(name, flown(case, kept)) for name, case in CLEAR.items())]

"""Measured tables of planned searches in difficult places. Each run costs a minute or so; more seeds take longer."""

import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from fanet_mw.trace import Collided, FlightModeChanged, Posed, Record
from fanet_mw.units import S
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog
from tests.tables.markdown import Rows

_NEAR_M: Final = (10.0, 20.0, 50.0)


class Case(NamedTuple):
    """A scenario with some keys, and the seeds with which it was measured."""

    scenario: str
    settings: tuple[str, ...]
    seeds: tuple[int, ...]


PLACES: Final[Mapping[str, Case]] = {
    "`town`": Case("town", (), (1, 2, 3, 9, 10, 11)),
    "`town`, batteries of 18 to 60 % at first": Case("town", ("sensors.battery_hz=1", "world.charge=[0.18,0.6]"), (1,)),
}
CLEAR: Final[Mapping[str, Case]] = {
    "hellos of neighbors and radar": Case("town", (), (1,)),
    "radar alone": Case("town", ('mission.avoid_by=["radar"]',), (1,)),
    "neither": Case("town", ("mission.avoid_by=[]",), (1,)),
}
Run = Mapping[str, Any]


def run(case: Case, seed: int) -> Run:
    """What one run came to."""
    outcome = simulate(catalog.find(case.scenario, [*case.settings, f"seed={seed}"]))
    world, records = outcome.reports["world"], outcome.records
    nearest = np.concatenate(list(_nearest_m(records)))
    return {
        **finish(outcome, out=None)["mission"],
        "solid": sum(1 for record in records if type(record) is Collided and not record.other),
        "no_fly": world["no_fly_entries"],
        "least_m": world["separation"].get("least_m"),
        "losses": world["separation"].get("losses"),
        "near": [float((nearest <= limit).mean()) for limit in _NEAR_M],
        "landed": len({r.node for r in records if type(r) is FlightModeChanged and r.mode == "land"}),
        "fell": len({r.node for r in records if type(r) is FlightModeChanged and r.mode == "fallen"}),
    }


def _nearest_m(records: Sequence[Record]) -> Iterator[np.ndarray]:
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
    ]


PLACES_HEAD: Final = [
    "scenario", "seeds", "everyone confirmed in", "confirmed", "mistaken", "last find [s], median", "error [m], median",
    "95 % covered after [s]", "connected, least [%]", "contacts with UAVs / solids", "no-fly areas entered",
    "landed early / fell",
]  # fmt: skip
CLEAR_HEAD: Final = [
    "others are known by", "seeds", "contacts", "nearer than 4 m", "least distance [m]",
    *(f"UAV-seconds within {limit:.0f} m [%]" for limit in _NEAR_M),
]  # fmt: skip


def clear_row(name: str, runs: Sequence[Run]) -> list[str]:
    """One line of the table of distances."""
    near = np.mean([found["near"] for found in runs], axis=0)
    return [
        name,
        str(len(runs)),
        f"{sum(found['collisions'] - found['solid'] for found in runs)}",
        f"{sum(found['losses'] for found in runs)}",
        f"{min(found['least_m'] for found in runs):.1f}",
        *(f"{100 * share:.2f}" for share in near),
    ]


def places() -> Rows:
    """Searches in a town, and with weak batteries."""
    return [PLACES_HEAD, *(places_row(n, [run(c, seed) for seed in c.seeds]) for n, c in PLACES.items())]


def keeping_clear() -> Rows:
    """How near UAVs come to each other in a town, with and without what the network delivers."""
    return [CLEAR_HEAD, *(clear_row(n, [run(c, seed) for seed in c.seeds]) for n, c in CLEAR.items())]

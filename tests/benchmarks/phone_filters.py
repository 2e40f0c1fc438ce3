"""How well UAVs know in flight where phones are, and whether they know how well: `phone_filters.py`.

Flies each scenario (`SCENARIO:SEED ...`) for 90 s without load, keeps what the three filters that know each phone first
take in, and asks anew 3 to 60 s after the first reception how probable the true place is. A filter that knows how well
it knows has the true place outside of its 90 % region in 10 % of the cases, and outside of its 99 % region in 1 %.
"""

import math
import statistics
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any, Final, NamedTuple
from unittest import mock

from agents.mission.finding.known_survivors import KnownSurvivor, KnownSurvivors
from agents.mission.finding.phone_localization import CELL_M, PhoneFilter, PhoneModel
from agents.mission.finding.phone_reception import PhoneReception
from agents.mission.searcher import phone_model
from fanet_mw.scenario import Scenario
from fanet_mw.units import Enu, S
from sim.run.virtual import simulate
from sim.scenarios import catalog
from sim.world.environment.survivors import Survivors

FLIGHTS: Final = ("hills:65", "rescue:71", "rescue:45")
SETTINGS: Final = ("traffic.interval_s=1000", "radio.lead_ms=0", "radio.handover_ms=0", "duration_s=90")
AFTER_S: Final = (3, 8, 15, 30, 60)
FILTERS: Final = 3
REGION_90: Final = 4.61
REGION_99: Final = 9.21
"""Quantiles of chi-square with 2 degrees of freedom."""
LEAST: Final = -30.0
"""The score of a place that is not in the grid."""


class Sample(NamedTuple):
    """What one filter took in: the power that a node received at a place, or none."""

    t_ns: int
    node: int
    at: Enu
    rssi_dbm: float | None


class Judged(NamedTuple):
    """What one filter says of the true place."""

    score: float
    """The log-probability, per cell of 20 m."""
    deficit: float
    error_m: float


class Flight:
    """The filters of all UAVs, by survivor, and what each takes in."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.filters: list[tuple[int, PhoneFilter]] = []
        self.samples: dict[int, list[Sample]] = {}

    def fly(self, scenario: Scenario) -> None:
        with ExitStack() as patches:
            for kind, name in ((KnownSurvivors, "take_report"), (PhoneReception, "scan"), (PhoneReception, "review")):
                patches.enter_context(mock.patch.object(kind, name, self._timed(getattr(kind, name))))
            for kind, name, kept in (
                (KnownSurvivors, "_first_heard", self._first_heard),
                (PhoneFilter, "on_rssi", self._on_rssi),
                (PhoneFilter, "on_silence", self._on_silence),
            ):
                patches.enter_context(mock.patch.object(kind, name, kept(getattr(kind, name))))
            simulate(scenario)

    def _timed(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def timed(of: object, *args: Any, **named: Any) -> Any:
            self.now_ns = named["now_ns"] if "now_ns" in named else args[0]
            return call(of, *args, **named)

        return timed

    def _first_heard(self, call: Callable[..., KnownSurvivor]) -> Callable[..., KnownSurvivor]:
        def first_heard(survivors: KnownSurvivors, survivor: int, now_ns: int) -> KnownSurvivor:
            known = call(survivors, survivor, now_ns)
            self.filters.append((survivor, known.filter))
            self.samples[id(known.filter)] = []
            return known

        return first_heard

    def _on_rssi(self, call: Callable[..., bool]) -> Callable[..., bool]:
        def on_rssi(phone: PhoneFilter, reporter: int, position: Enu, rssi_dbm: float) -> bool:
            self.samples[id(phone)].append(Sample(self.now_ns, reporter, position, rssi_dbm))
            return call(phone, reporter, position, rssi_dbm)

        return on_rssi

    def _on_silence(self, call: Callable[..., None]) -> Callable[..., None]:
        def on_silence(phone: PhoneFilter, position: Enu) -> None:
            self.samples[id(phone)].append(Sample(self.now_ns, 0, position, None))
            call(phone, position)

        return on_silence

    def first(self, survivor: int) -> list[list[Sample]]:
        """What the filters took in that knew this survivor first."""
        heard = [self.samples[id(phone)] for of, phone in self.filters if of == survivor]
        return sorted((log for log in heard if any(sample.node for sample in log)), key=first_ns)[:FILTERS]


def first_ns(log: list[Sample]) -> int:
    return next(sample.t_ns for sample in log if sample.node)


def replayed(log: list[Sample], model: PhoneModel, true: Enu) -> Iterator[tuple[int, Judged]]:
    """What a filter says of the true place after each of `AFTER_S`."""
    phone, due_s = PhoneFilter(model), list(AFTER_S)
    for t_ns, node, at, rssi_dbm in log:
        while due_s and t_ns - first_ns(log) > due_s[0] * S:
            after_s, place = due_s.pop(0), phone.estimate_by_power()
            if place is not None:
                deficit = phone.deficit(true.east, true.north)
                total = math.fsum(math.exp(-off / 2) for _, _, off in phone.likely_cells(40.0))
                score = max(LEAST, -deficit / 2 - math.log(total) - 2 * math.log(CELL_M / 20))
                yield after_s, Judged(score, deficit, place.distance_m(true))
        if rssi_dbm is None:
            phone.on_silence(at)
        else:
            phone.on_rssi(node, at, rssi_dbm)


def main() -> None:
    found: dict[int, list[Judged]] = {after_s: [] for after_s in AFTER_S}
    for flight in sys.argv[1:] or FLIGHTS:
        name, _, seed = flight.partition(":")
        scenario = catalog.find(name, [f"seed={seed}", *SETTINGS])
        flown = Flight()
        flown.fly(scenario)
        for survivor, at in enumerate(Survivors(scenario).places, 1):
            for log in flown.first(survivor):
                for after_s, judged in replayed(log, phone_model(scenario), Enu(*map(float, at))):
                    found[after_s].append(judged)
    print("after [s]  filters  score  outside of 90 %  of 99 %  error, median [m]")
    rows = {str(after_s): cases for after_s, cases in found.items()}
    rows["all"] = [case for cases in found.values() for case in cases]
    for after, cases in rows.items():
        print(
            f"{after:>9} {len(cases):>8} {statistics.mean(case.score for case in cases):>6.2f}"
            f" {statistics.mean(case.deficit > REGION_90 for case in cases):>16.3f}"
            f" {statistics.mean(case.deficit > REGION_99 for case in cases):>8.3f}"
            f" {statistics.median(case.error_m for case in cases):>18.0f}"
        )


if __name__ == "__main__":
    main()

"""What becomes of timetables and of phones' places when what nodes take for true is false: `false_assumptions.py`.

Scenario `clusters`, 30 s, seed 1: channel, world and applications follow the scenario, some or all nodes are told
another one. Phones: one in the field beside two lanes 150 m apart, heard every 30 m with 4 dB of shadowing, 40 draws;
its power is another one than the receiver takes it to be. Survivors who are confirmed before have such phones, too,
1 dB from each other, which one more UAV heard that circled about each of them.
"""

import math
import random
import statistics
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from agents.applications.traffic import Load, sources_of
from agents.clock.clocked_uav import make_uav
from agents.mission.finding.calibration import common_offset, likelihood
from agents.mission.finding.least_squares import PowerReading, estimate
from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, Estimate, PhoneFilter, PhoneModel, PhoneOffset
from fanet_mw.scenario import Traffic
from fanet_mw.trace import BoundStated, RadioFault
from fanet_mw.units import MS, Enu, NodeId
from sim.records.record_kinds import records_of
from sim.results.bounds import against_bounds
from sim.results.outcome import Outcome
from sim.results.packets import packets_of
from sim.scenarios import catalog
from sim.world.environment.layout import positions
from tests.benchmarks.told_swarm import run_with

_SEEDS: Final = (1,)
_HALF: Final = ("traffic.interval_s=0.5",)
_OFTEN: Final = ("traffic.interval_s=0.125",)
_HEARD: Final = ("clusters.load=heard",)
_CLOCKS: Final = (
    "clock.sync=beacons",
    "clock.drift_ppm=20",
    "clusters.turn_slack_us=250",
    "warmup_s=25",
    "duration_s=50",
)
_HASTY: Final = (5, 15, 25, 35, 45)
_MORE: Final = Traffic(name="more", interval_s=1 / 3, payload_bytes=1000, arrivals="cbr", sources=_HASTY)
"""Three more packets a second, of which nodes are told nothing."""


class Case(NamedTuple):
    """What is so, and what nodes are told."""

    settings: tuple[str, ...] = ()
    told: tuple[str, ...] = ()
    who: tuple[int, ...] | None = None
    """The nodes that are told; None: all."""
    more: bool = False
    """Whether `_HASTY` send `_MORE` as well."""
    duration_s: float = 30


CASES: Final[Mapping[str, Case]] = {
    "nothing": Case(),
    "five nodes send four times as much as `[traffic]` says, 60 s": Case(more=True, duration_s=60),
    "the same with `clusters.load = \"heard\"`": Case(_HEARD, more=True, duration_s=60),
    "a packet of each comes every 0.5 s, where `[traffic]` says 0.125 s, 60 s": Case(_HALF, _OFTEN, duration_s=60),
    "the same with `load = \"heard\"`": Case((*_HALF, *_HEARD), _OFTEN, duration_s=60),
    "five nodes have another scenario (`traffic.interval_s`), and so another timetable": Case(
        (), ("traffic.interval_s=0.25",), _HASTY
    ),
    "45 nodes take the swarm for 60": Case((), ("nodes.count=60",)),
    "`link_m` 300 m, the range is 250 m": Case((), ("clusters.link_m=300",)),
    "`interference_m` 250 m in `log_distance`": Case(
        ("radio.channel=log_distance",), ("clusters.interference_m=250",)
    ),
    "stamps of 1 us, clocks of 20 ppm by beacons, slack 250 us, 50 s": Case((*_CLOCKS, "clock.timestamp_us=1")),
    "the same, stamps of 100 us": Case((*_CLOCKS, "clock.timestamp_us=100")),
    "the same, stamps of 1000 us": Case((*_CLOCKS, "clock.timestamp_us=1000")),
}  # fmt: skip


def flown(case: Case, *, seed: int) -> Outcome:
    """A run in which nodes have been told what the case says. Applications send what is so."""
    common = [f"duration_s={case.duration_s:g}", f"seed={seed}", *case.settings]
    true = catalog.find("clusters", common)
    first = true.traffic.model_copy(update={"name": "first", "sources": tuple(sources_of(true))})
    scenario = true.model_copy(update={"traffic": first, "further_traffic": (_MORE,) if case.more else ()})
    told = catalog.find("clusters", [*common, "traffic.sources=0", *case.told])
    knowing = catalog.find("clusters", [*common, "traffic.sources=0"])
    starts = positions(scenario)
    uavs = [
        make_uav(
            told if case.who is None or n in case.who else knowing,
            NodeId(n),
            scenario.name,
            position=starts[n - 1],
            applications=[Load(scenario, NodeId(n), name) for name in scenario.traffic_classes],
        )
        for n in scenario.node_ids
    ]
    return run_with(scenario, uavs)


def swarm_row(name: str, case: Case) -> list[str]:
    """PDR, stated share, share within the bound, broken: the mean and the sum over the seeds, of what has targets; and
    the median of the bounds that were stated in the last third.
    """
    bounds: list[dict[str, Any]] = []
    pdr, last_ms = [], []
    for seed in _SEEDS:
        outcome = flown(case, seed=seed)
        found = {app: of for app, of in packets_of(outcome).items() if of.wanted}
        late_ns = 2 * outcome.scenario.duration_ns // 3
        last_ms += [
            record.bound_ns / MS for record in records_of(outcome.records, BoundStated) if record.t_ns >= late_ns
        ]
        pdr.append(sum(len(app.deliveries) for app in found.values()) / sum(app.wanted for app in found.values()))
        faults = records_of(outcome.records, RadioFault)
        bounds.append(against_bounds(found, faults, ended_ns=outcome.simulated_ns))
    stated = statistics.fmean(bound.get("stated_share", 0.0) for bound in bounds)
    within = statistics.fmean(bound.get("within_share", 0.0) for bound in bounds)
    broken = sum(bound.get("violations", 0) for bound in bounds)
    last = f"{statistics.median(last_ms):.0f}" if last_ms else ""
    return [name, f"{statistics.fmean(pdr):.3f}", f"{stated:.3f}", f"{within:.3f}", f"{broken}", last]


def swarms() -> list[list[str]]:
    """The table of timetables, header first."""
    head = [
        "what is false",
        "PDR",
        "packets with a bound",
        "within it, of packets x targets",
        "broken",
        "bound at the end [ms]",
    ]
    return [head, *(swarm_row(name, case) for name, case in CASES.items())]


_PHONE: Final = PhoneModel(
    power_dbm=15.0, exponent=3.0, shadowing_db=4.0, offset_db=1.0, threshold_dbm=-90.0, half_m=math.inf
)


_LANES: Final = tuple((lane, Enu(30.0 * step, 150.0 * lane, 50.0)) for lane in (0, 1) for step in range(-8, 9))
_CONFIRMED_BEFORE: Final = (1, 3)
_CIRCLE_M: Final = 40.0
_PLACE_VARIANCE_M2: Final = 4.0


def received_dbm(phone: Enu, here: Enu, offset_db: float, drawn: random.Random) -> float:
    """The power at a place of a phone that is so much stronger than assumed, shadowing included."""
    lost_db = REFERENCE_LOSS_DB + 10 * _PHONE.exponent * math.log10(here.minus(phone).norm())
    return _PHONE.power_dbm + offset_db - lost_db + drawn.gauss(0.0, _PHONE.shadowing_db)


def somewhere(drawn: random.Random) -> Enu:
    """The place of a phone beside the lanes."""
    return Enu(drawn.uniform(-40, 40), drawn.uniform(30, 90), 0.0)


def offset_told(offset_db: float, draw: int, *, confirmed: int) -> PhoneOffset:
    """What the phones of so many confirmed survivors tell of the offset that is common to all."""
    phones = []
    for before in range(confirmed):
        drawn = random.Random(f"{draw}/confirmed/{before}")
        phone, own_db = somewhere(drawn), drawn.gauss(0.0, _PHONE.offset_db)
        turns = [turn * math.pi / 4 for turn in range(8)]
        circle = [
            Enu(phone.east + _CIRCLE_M * math.cos(turn), phone.north + _CIRCLE_M * math.sin(turn), 50.0)
            for turn in turns
        ]
        places = [*(here for _, here in _LANES), *circle]
        powers = [(here, received_dbm(phone, here, offset_db + own_db, drawn)) for here in places]
        at = Estimate(phone.east, phone.north, _PLACE_VARIANCE_M2, 0.0, _PLACE_VARIANCE_M2)
        phones.append(likelihood(at, [power for power in powers if power[1] >= _PHONE.threshold_dbm], _PHONE))
    return common_offset(phones)


def phone_errors_m(offset_db: float, draw: int) -> list[float] | None:
    """How far from the phone the estimates are: the filter's of the planned search, also after some survivors have
    been confirmed, and the least squares of the paper's rule.
    """
    drawn = random.Random(draw)
    phone = somewhere(drawn)
    told = [offset_told(offset_db, draw, confirmed=confirmed) for confirmed in (0, *_CONFIRMED_BEFORE)]
    filters, heard = [PhoneFilter(_PHONE, offset) for offset in told], []
    for lane, here in _LANES:
        rssi_dbm = received_dbm(phone, here, offset_db, drawn)
        if rssi_dbm >= _PHONE.threshold_dbm:
            heard.append(PowerReading(here, rssi_dbm))
        for search in filters:
            if rssi_dbm < _PHONE.threshold_dbm:
                search.on_silence(here)
            else:
                search.on_rssi(lane, here, rssi_dbm)
    if not heard:
        return None
    fitted = estimate(heard, phone_power_dbm=_PHONE.power_dbm, exponent=_PHONE.exponent)
    found = [search.estimate() for search in filters]
    return [
        *(place.distance_m(phone) for place in found if place is not None),
        math.hypot(fitted.east - phone.east, fitted.north - phone.north),
    ]


def phones() -> list[list[str]]:
    """The table of phones, header first."""
    columns = [
        "filter", *(f"filter after {confirmed} confirmed" for confirmed in _CONFIRMED_BEFORE), "least squares",
    ]  # fmt: skip
    rows = [["the phones' power against what is assumed", *(f"{column}: median error [m]" for column in columns)]]
    for offset_db in (0, -3, -6, 3, 6):
        errors = [found for draw in range(40) if (found := phone_errors_m(offset_db, draw)) is not None]
        medians = [statistics.median(error) for error in zip(*errors, strict=True)]
        rows.append([f"{offset_db:+d} dB", *(f"{median:.0f}" for median in medians)])
    return rows


if __name__ == "__main__":
    for table in (phones, swarms):
        for row in table():
            print("|", " | ".join(row), "|", flush=True)

"""Beyond the paper: the age of survivor reports, and how long a search takes when the network gets worse."""

import re
from collections.abc import Callable
from typing import Final

from sim.figures.curves import Panel, curves
from sim.figures.finished_runs import Quantity, Row, Runs, differences
from sim.figures.paper_claims import Claim, Reason, Statement, above, below
from sim.figures.recipe import Recipe
from sim.figures.statistics import DISTANCE, interval

_LOSS: Final = re.compile(r"loss_share = ([0-9.e-]+)")
_RIVALS: Final = {"paper": "the paper's method", "flooding": "plain flooding"}
_HALF: Final = 0.5
_MOST: Final = 0.8
_HARDLY_S: Final = 5.0
_END_S: Final = 80.0
"""The length of a run, which stands for the time of a search that did not end."""


def loss_share(faults: str) -> float:
    """The share of frames that each link loses, by the scenario's faults as TOML."""
    found = _LOSS.search(faults)
    return float(found[1]) if found else 0.0


def confirmed_s(row: Row, share: float) -> float:
    """The instant at which this share of the survivors was confirmed, else the end of the run [s]."""
    times = sorted(row["mission.time_to_confirm_s"] or ())
    wanted = _people(row, share)
    return float(times[wanted - 1] if len(times) >= wanted else row["duration_s"])


def _people(row: Row, share: float) -> int:
    """The number of survivors in a share of them, at least one."""
    return max(1, round(share * int(row["mission.survivors"])))


def _half_s(row: Row) -> float:
    return confirmed_s(row, _HALF)


def _all_s(row: Row) -> float:
    return confirmed_s(row, 1.0)


def _misses(share: float) -> Callable[[Row], bool]:
    """Whether a run ended before this share of the survivors was confirmed."""
    return lambda row: len(row["mission.time_to_confirm_s"] or ()) < _people(row, share)


def claims_reports(runs: Runs) -> list[Claim]:
    intervals = list(reversed(runs.levels("mission.report_interval_s")))

    def lead(quantity: Quantity, rival: str, interval_s: float) -> list[float]:
        """A quantity of fanet-mw minus that of a rival."""
        ours, theirs = (
            runs.per_seed(quantity, case=case, mission__report_interval_s=interval_s) for case in ("ours", rival)
        )
        return differences(ours, theirs)

    def at_each(
        side: Callable[..., Statement], what: str, quantity: Quantity, rival: str, unit: str = ""
    ) -> list[Statement]:
        return [side(f"every {at:g} s: {what}", lead(quantity, rival, at), 0.0, unit) for at in intervals]

    waits = Reason(
        "A flooded report goes out at once; fanet-mw's waits for its head's slot and for relays to count copies, and "
        "what is lost is sent again later. For news that is repeated anyway a lost report costs one interval, which is "
        "less than such a wait: slots and repair are for what is said once.",
        at_each(
            above,
            "median delay of reports, fanet-mw minus plain flooding",
            "reports.delay_ms.p50",
            "flooding",
            "ms",
        ),
    )
    no_sooner = Reason(
        "More of them arrive, but not sooner: reports wait for slots under both, and the newest that has arrived is "
        "about as old.",
        at_each(above, "share of reports delivered, fanet-mw minus the paper's method", "reports.pdr", "paper"),
    )
    return [
        Claim(
            0,
            f"Reports by fanet-mw are younger than by {name}.",
            at_each(below, f"age by fanet-mw minus by {name}", "report_age_s", rival, "s"),
            [waits if rival == "flooding" else no_sooner],
        )
        for rival, name in _RIVALS.items()
    ]


def claims_mission(runs: Runs) -> list[Claim]:
    of_share = {loss_share(faults): faults for faults in runs.levels("faults")}

    def at(quantity: Quantity, case: str, share: float) -> dict[int, float]:
        return runs.per_seed(quantity, case=case, faults=of_share[share]) if share in of_share else {}

    def slower(quantity: Quantity, share: float) -> list[float]:
        return differences(at(quantity, "ours", share), at(quantity, "ours", 0.0))

    half_s = list(at(_half_s, "ours", 0.0).values())
    places = Reason(
        "Where the survivors of a seed are makes more of the time than the network does: too much to tell a delay of "
        "seconds from these seeds.",
        [
            above(
                "until half are confirmed, none lost: a seed's distance from the mean of all",
                [abs(one_s - interval(half_s).mean) for one_s in half_s],
                _HARDLY_S,
                "s",
                possible=DISTANCE,
            )
        ],
    )
    judged = [
        Claim(
            0,
            "Without a network the search takes longer.",
            [
                above("until half are confirmed: no network minus a good one", slower(_half_s, 1.0), 0.0, "s"),
                above("until all are confirmed: no network minus a good one", slower(_all_s, 1.0), 0.0, "s"),
            ],
        ),
        Claim(
            0,
            "Links that lose half of all frames hardly delay it.",
            [
                below("until half are confirmed: half lost minus none", slower(_half_s, _HALF), _HARDLY_S, "s"),
                below("until all are confirmed: half lost minus none", slower(_all_s, _HALF), _HARDLY_S, "s"),
            ],
            [places],
        ),
        Claim(
            0,
            "Where most frames are lost fanet-mw delivers the most reports.",
            [
                above(
                    f"{_MOST:.0%} lost: reports delivered, fanet-mw minus {name}",
                    differences(at("reports.pdr", "ours", _MOST), at("reports.pdr", rival, _MOST)),
                    0.0,
                )
                for rival, name in _RIVALS.items()
            ],
        ),
    ]
    return [claim for claim in judged if any(statement.values for statement in claim.statements)]


REPORTS: Final = Recipe(
    "reports",
    "Age of survivor reports",
    "reports",
    "45 UAVs fly in formation over 16 survivors, each reports the phones that it hears to everyone, as often as the "
    "horizontal axis says, beside 1024 B of each every second. fanet-mw: every node a head, flooding period 0.5 s, "
    "relays that count copies, repair; the paper's method: 4 clusters, 5 s. Age: how long ago the newest report was "
    "made that a UAV has of another one, mean over time and pairs, from a reporter's first report to its last.",
    curves(
        "mission.report_interval_s",
        "a report of each UAV every [s]",
        [
            Panel("report_age_s", "mean age of reports [s]", log=True),
            Panel("reports.pdr", "reports delivered, share", share=True),
            Panel("reports.delay_ms.p50", "median delay of reports [s]", log=True, factor=1e-3),
        ],
        variants={
            "ours": "fanet-mw: 44 heads, 0.5 s, counter, repair",
            "paper": "the paper's method, 4 clusters, 5 s",
        },
    ),
    claims_reports,
)
MISSION: Final = Recipe(
    "mission",
    "Time of the mission against the network's quality",
    "mission",
    "A small planned search: 12 UAVs, 500 x 500 m, 6 survivors, 80 s, 1024 B of each UAV to everyone every s. Every "
    "link loses this share of the frames that would have been received; at 1 every UAV is alone. A search that has not "
    "ended with the run counts as 80 s, so that its time is at least what is drawn: hollow marks where some seeds were "
    "cut so, an arrow where all were.",
    curves(
        "faults",
        "share of frames that every link loses",
        [
            Panel(_half_s, "time until half are confirmed [s]", most=_END_S, cut=_misses(_HALF)),
            Panel(_all_s, "time until all are confirmed [s]", most=_END_S, cut=_misses(1.0)),
            Panel("reports.pdr", "reports delivered, share", share=True),
        ],
        value=loss_share,
        linear=True,
        variants={
            "ours": "fanet-mw: rounds",
            "paper": "the paper's method, 4 clusters, 5 s",
        },
    ),
    claims_mission,
)

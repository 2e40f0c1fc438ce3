"""What UAVs lost in flight do to the others: from the lines that `scripts/losses.py` has printed into a file."""

import json
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from agents.mission.search_formation.pattern import Pattern, fitted
from agents.mission.search_formation.shapes.contract import Demands, ShapeName
from fanet_mw.units import Enu
from sim.results.links_over_time import parts
from tests.tables.markdown import Rows

_DATA: Final = Path(__file__).parents[2] / "docs" / "results" / "data"
_ASKED_S: Final = 15.0
_AGAIN_S: Final = 3.0
_WORDS: Final = {0: "none", 1: "one", 2: "two", 3: "three", 4: "four", 5: "five"}
_CURVE_FROM: Final = 6
"""So many losses one after the other are a line of the curve."""
_STEP: Final = 2
"""So many losses lie between two rows of it."""
_PLANNED_S: Final = 3.0
_SEEN_S: Final = 17.0
"""So long after its last loss a copy is looked at that is not flown to the end."""
_REACH_M: Final = 250.0
_NOTICES_S: Final = 0.9
"""In flight the two beside a gap notice it 0.7 to 1 s after the loss."""
_CLOSES_M_S: Final = 10.0
_SPEEDS_UP_S: Final = 2.0
"""They reach this speed so long after that, at 5 m/s2."""
_FLIGHT_S: Final = 300.0
_TAKEN_UP_S: Final = 50.0
Copy = dict[str, Any]


def _lines(name: str) -> list[Copy]:
    return [json.loads(line) for line in (_DATA / f"{name}.jsonl").read_text().splitlines()]


def _copies() -> list[Copy]:
    return _lines("losses")


def healing() -> Rows:
    """How soon the others are one network again, and their reports have bounds again."""
    head = [
        "mission", "lost", "times (flights)", "one network again within 15 s", "never apart", "median / worst [s]",
        "bounds again 3 s after that", "as often as without a loss", "broken",
    ]  # fmt: skip
    groups: dict[tuple[str, str], list[Copy]] = {}
    once = {
        (copy["scenario"], copy["seed"], str(copy["losses"])): copy for copy in _copies()
    }  # some were flown on, too
    for copy in once.values():
        if 0 < len(copy["losses"]) < _CURVE_FROM:
            groups.setdefault((copy["scenario"], _lost(copy)), []).append(copy)
    return [head, *(_healing_row(*name, copies) for name, copies in groups.items())]


def _lost(copy: Copy) -> str:
    number = _WORDS[len(copy["losses"])]
    if number in ("none", "one"):
        return number
    every_s = copy["losses"][1][0] - copy["losses"][0][0]
    return f"{number}, every {every_s:.0f} s" if every_s else f"{number} at once"


def _healing_row(mission: str, lost: str, copies: Sequence[Copy]) -> list[str]:
    heal_s = [one for copy in copies for one in copy["heal_s"]]
    judged = [copy for copy in copies if copy.get("bounded", [None, None])[1]]  # without a loss bounds are stated
    again = sum(copy["bounds_s"] <= copy["heal_s"][-1] + _AGAIN_S for copy in judged)
    broken = [copy["broken"] for copy in judged if "broken" in copy]
    within = f"{sum(one <= _ASKED_S for one in heal_s)} of {len(heal_s)}"
    if len(heal_s) > len(copies):
        whole = sum(max(copy["heal_s"]) <= _ASKED_S for copy in copies)
        within += f"; all of them in {whole} of {len(copies)}"
    as_good = sum((copy["bounded"][0] or 0) >= (copy["bounded"][1] or 0) for copy in judged)
    return [
        mission,
        lost,
        f"{len(copies)} ({len({copy['seed'] for copy in copies})})",
        within,
        f"{sum(not one for one in heal_s)}",
        f"{statistics.median(heal_s):.1f} / {_worst(copies)}",
        f"{again} of {len(judged)}" if judged else "-",
        f"{as_good} of {len(judged)}" if judged else "-",
        f"{sum(broken)}" if broken else "-",
    ]


def _worst(copies: Sequence[Copy]) -> str:
    """The longest time apart; more than what was seen of a copy that was still apart when it ended."""
    longest = max(copies, key=lambda copy: max(copy["heal_s"]))
    heal_s = max(longest["heal_s"])
    return f"> {_SEEN_S:.0f}" if heal_s >= _SEEN_S and "found" not in longest else f"{heal_s:.1f}"


def by_geometry() -> Rows:
    """What one drawn loss does to a formation flown exactly, if those beside the gap fly towards each other at once."""
    demands = Demands(area_m=2500.0, seen_m=131.0, reach_m=_REACH_M, height_m=65.0, speed_m_s=7.5)
    lines, ring = fitted(45, demands), fitted(45, demands, shape=ShapeName.RING)
    assert lines is not None, "45 UAVs are enough for both"
    assert ring is not None, "45 UAVs are enough for both"
    grid = [Enu(200.0 * (one % 7 - 3), 200.0 * (one // 7 - 3), 65.0) for one in range(45)]
    begun = lines.begun_around(grid)[0].dimensions
    flown = {
        "lines, as flown": begun,
        "lines, two followers as lanes": begun._replace(lanes=begun.lanes + 1, followers=begun.followers - 2),
        "lines, all followers as relays": begun._replace(relays=begun.relays + begun.followers, followers=0),
        "ring": ring.dimensions,
    }
    head = ["45 UAVs, 2.5 x 2.5 km", "never apart", "median / worst [s]", "connected since"]
    return [head, *([name, *_row_by_geometry(Pattern(made, reach_m=_REACH_M))] for name, made in flown.items())]


def _row_by_geometry(pattern: Pattern) -> list[str]:
    heal_s, connected = list[float](), list[float]()
    for swept_s in range(0, 190, 10):
        at = np.array([pattern.at(place, float(swept_s)) for place in range(pattern.places)])
        follows = np.array([pattern.kind(place) == "follower" for place in range(pattern.places)])
        for lost in range(pattern.places):
            left = np.arange(pattern.places) != lost
            apart_m = np.linalg.norm(at[left, None] - at[None, left], axis=2)
            part = parts(apart_m <= _REACH_M)
            one = 0.0
            if part.any():
                may_close = (part[:, None] != part[None]) & ~follows[left, None] & ~follows[None, left]
                one = _NOTICES_S + _SPEEDS_UP_S / 2 + (apart_m[may_close].min() - _REACH_M) / (2 * _CLOSES_M_S)
            heal_s.append(one)
            connected.append(1 - one / (_FLIGHT_S - _TAKEN_UP_S - swept_s))
    never = sum(not one for one in heal_s) / len(heal_s)
    return [
        f"{100 * never:.0f} %",
        f"{statistics.median(heal_s):.1f} / {max(heal_s):.1f}",
        f"{statistics.fmean(connected):.3f}",
    ]


def to_the_end() -> Rows:
    """What becomes of the search, where a copy was flown to its end."""
    head = ["mission", "lost", "times", "everyone found in", "connected since", "reports delivered", "contacts"]
    groups: dict[tuple[str, str], list[Copy]] = {}
    for copy in _copies():
        if "found" in copy and len(copy["losses"]) < _CURVE_FROM:
            groups.setdefault((copy["scenario"], _lost(copy)), []).append(copy)
    return [
        head,
        *(
            [
                *name,
                f"{len(copies)}",
                f"{sum(copy['found'] == copy['of'] for copy in copies)}",
                _mean_and_least([copy["connected"] for copy in copies]),
                _mean_and_least([copy["pdr"] for copy in copies]),
                f"{sum(copy['contacts'] for copy in copies)}",
            ]
            for name, copies in groups.items()
        ),
    ]


def _mean_and_least(shares: Sequence[float]) -> str:
    return f"{statistics.fmean(shares):.3f}, least {min(shares):.3f}"


def curve() -> Rows:
    """What is left as more and more are lost, one after the other."""
    flown = [copy for copy in _copies() if len(copy["losses"]) >= _CURVE_FROM]
    head = ["lost", "living in one network since the row before", "area covered", "found"]
    rows = []
    for rank in range(_STEP - 1, min((len(copy["curve"]) for copy in flown), default=0), _STEP):
        here = [copy["curve"][rank] for copy in flown]
        rows.append(
            [
                f"{here[0][0]}",
                " / ".join(
                    f"{statistics.fmean(one[1] for one in copy['curve'][rank + 1 - _STEP : rank + 1]):.2f}"
                    for copy in flown
                ),
                " / ".join(f"{one[2]:.2f}" for one in here),
                " / ".join(f"{one[3]}" for one in here),
            ]
        )
    return [head, *rows]


def partitions() -> Rows:
    """What a partition of the air does, from the lines that `scripts/partitions.py` has printed."""
    head = [
        "flown", "times (flights)", "one planner in each part after 3 s",
        "later, until again so: median / worst [s]", "one for all 3 s after the air is whole",
        "who found what is known to all by then", "least distance [m]",
    ]  # fmt: skip
    groups: dict[str, list[Copy]] = {}
    for line in _lines("partitions"):
        groups.setdefault(_how_flown(line), []).append(line)
    return [head, *(_partition_row(how, lines) for how, lines in groups.items())]


def _how_flown(line: Copy) -> str:
    if "processes" not in line:
        return f"{line['scenario']}, virtual time"
    killed = f", {_WORDS[len(line['killed'])]} killed and started again" if line["killed"] else ""
    return f"{line['processes']} UAVs as processes{killed}"


def _partition_row(how: str, lines: Sequence[Copy]) -> list[str]:
    planned = sum(all(planners == 1 for _, planners in one["parts"]["3"]) for one in lines)
    later_s = [until_s - from_s for one in lines for from_s, until_s in one["wrong"] if from_s >= _PLANNED_S]
    return [
        how,
        f"{len(lines)} ({len({one['seed'] for one in lines})})",
        f"{planned}",
        f"{statistics.median(later_s):.1f} / {max(later_s):.1f}" if later_s else "-",
        f"{sum(_has_one_planner(one['merged']['3']) for one in lines)}",
        f"{sum(not one['unknown']['3'] for one in lines)}",
        f"{min(one['least_m'] for one in lines)}",
    ]


def _has_one_planner(merged: int | list[list[int]]) -> bool:
    """True if there is one planner for all, or, where the sizes of parts were recorded, one in each part."""
    return merged == 1 if isinstance(merged, int) else all(planners == 1 for _, planners in merged)

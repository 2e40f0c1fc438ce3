"""Figure 12: how soon UAVs turn towards survivors, by network and load."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from matplotlib.axes import Axes

from sim.figures.finished_runs import Quantity, Row, Runs, differences
from sim.figures.paper_claims import Claim, Reason, Statement, above, below, share_above, share_below
from sim.figures.recipe import Drawing, Recipe, point
from sim.figures.statistics import DISTANCE, SHARE, Interval, Possible, interval
from sim.figures.style import Look, beside, canvas, legend_above, line, look_of, plain_log, ticks_at

_LETTERS: Final = "abcdefgh"
_CASES: Final = ("flooding", "paper", "ours")
_VARIANTS: Final = {
    "ours": "fanet-mw: 44 heads, 0.5 s, counter, repair",
    "paper": "the paper's method, 4 clusters, 5 s",
}
_FLOWN: Final = "paper, physics engine"
_INTERVAL: Final = "mission.report_interval_s"
_AT: Final = "mission__report_interval_s"
_SLOW_S, _FAST_S = 1.0, 0.1
_EARLY_S: Final = 55.0
_MANY: Final = 30
_SWARM: Final = Possible(0, 45)
_NEARLY_ALL: Final = 43
_FEW: Final = 5
_WINDOW_S: Final = (50.0, 70.0)
_MOST: Final = 0.5
_HARDLY_S: Final = 5.0
_AT_ONCE_S: Final = 1.0
"""One period of reports; the instants of turning are tens of seconds."""
_LIMIT_SET_AFTERWARDS: Final = "the limit of 1 s. It was 0.1 s, which three seeds kept; ten leave that open."
_SECONDS_S: Final = 5.0
_FREE: Final = 0.5
_SINCE_S: Final = tuple(math.pow(10.0, step / 10) for step in range(-30, 19))
"""The edges of the classes of time, from a millisecond to more than a minute."""
_STEP_S: Final = 0.5
"""The distance of the instants at which turned UAVs are counted for the mean."""
_BARS_S: Final = (30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0)
_BARS_SINCE_S: Final = (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""The instants at which the interval of a mean is drawn."""
_APART_S: Final = 1.3
_APART: Final = 0.18
_NEAR: Final = 0.05
"""The distance of the bars of two methods: a time, or a share on a logarithmic axis."""


def _times(row: Row) -> list[float]:
    """The instants at which UAVs changed course [s]."""
    return list(row["first_approach_s"] or ())


def _by(limit_s: float) -> Callable[[Row], float]:
    """The number of UAVs that have changed course by an instant."""
    return lambda row: float(sum(time_s <= limit_s for time_s in _times(row)))


def _at_end(row: Row) -> float:
    return float(len(_times(row)))


def _at_end_if_any(row: Row) -> float | None:
    """UAVs that have changed course at the end; None if none has, because three never received the same phone."""
    return _at_end(row) or None


def _heard(row: Row) -> float:
    return float(len(row["first_detected_s"] or ()))


def _half_s(row: Row) -> float | None:
    """The instant by which half of the swarm has changed course; None if it never has."""
    times, half = sorted(_times(row)), math.ceil(row["nodes"] / 2)
    return times[half - 1] if len(times) >= half else None


def _wait_s(row: Row) -> float | None:
    """The time from when enough UAVs have received the same phone until half of the swarm has turned."""
    half_s, heard_s = _half_s(row), row["enough_heard_s"]
    return None if half_s is None or heard_s is None else half_s - heard_s


def _in_window(row: Row) -> float | None:
    times = _times(row)
    return sum(_WINDOW_S[0] <= time_s <= _WINDOW_S[1] for time_s in times) / len(times) if times else None


def _after(limit_s: float) -> Callable[[Row], float]:
    """UAVs that have changed course so long after enough had received a phone; 0 if that never happened."""
    return lambda row: _by((row["enough_heard_s"] or 0.0) + limit_s)(row)


class _TimeAxis(NamedTuple):
    """A time over which UAVs that have turned are counted: where it begins, and at which instants a bar is drawn."""

    column: str
    label: str
    instants_s: Sequence[float]
    bars_s: Sequence[float]
    log: bool
    quantity: Callable[[float], Callable[[Row], float]]
    """For an instant, a function that gives the number of UAVs of a run that have turned by then."""


def _draw_shares(axes: Axes, look: Look, rows: Sequence[Row], clock: _TimeAxis, place: int) -> list[Mapping[str, Any]]:
    """The mean share of UAVs that have turned by each instant; bars show its interval at some of them."""

    def shares(instants_s: Sequence[float]) -> list[Interval]:
        return [interval([clock.quantity(at)(row) / row["nodes"] for row in rows], SHARE) for at in instants_s]

    every, barred = shares(clock.instants_s), shares(clock.bars_s)
    axes.plot(clock.instants_s, [one.mean for one in every], color=look.color, linestyle=look.dash)
    apart = _APART if clock.log else _APART_S
    at_s = [beside(at, place, len(_CASES), log=clock.log, apart=apart) for at in clock.bars_s]
    line(axes, look._replace(dash="none"), at_s, barred, most=1.0)
    return [point(one, **{clock.column: at}) for one, at in zip(every, clock.instants_s, strict=True)]


def _draw_delivery(axes: Axes, runs: Runs, quantity: str) -> list[Mapping[str, Any]]:
    """What arrives of an application, over how often app_2 is sent."""
    data: list[Mapping[str, Any]] = []
    intervals = runs.levels(_INTERVAL)
    for place, case in enumerate(_CASES):
        found = [runs.of(quantity, case=case, **{_AT: interval_s}) for interval_s in intervals]
        kept = [(at, one) for at, one in zip(intervals, found, strict=True) if one.runs]
        if not kept:
            continue  # a sweep without this method
        at_s = [beside(at, place, len(_CASES), log=True, apart=_NEAR) for at, _ in kept]
        line(axes, look_of(case, _VARIANTS), at_s, [one for _, one in kept], most=1.0)
        data += [point(one, app_2_interval_s=at, series=case, delivered=quantity) for at, one in kept]
    axes.set_xscale("log")
    ticks_at(axes.xaxis, {at: f"{at:g}" for at in intervals})
    axes.set_xlabel("app_2 every [s]")
    return data


def draw(runs: Runs) -> Drawing:
    intervals = list(reversed(runs.levels(_INTERVAL)))
    columns = len(intervals) + 1
    figure, panels = canvas(columns, 2, share_y=True, width=3.4, height=2.9)
    end_s = max(row["duration_s"] for row in runs.rows)
    clocks = (
        _TimeAxis(
            "since_start_s",
            "time since the start [s]",
            [step * _STEP_S for step in range(round(end_s / _STEP_S) + 1)],
            [at for at in _BARS_S if at < end_s],
            log=False,
            quantity=_by,
        ),
        _TimeAxis(
            "since_heard_s",
            "time since three had heard a phone [s]",
            _SINCE_S,
            _BARS_SINCE_S,
            log=True,
            quantity=_after,
        ),
    )
    data: list[Mapping[str, Any]] = []
    for row_of_panels, clock in enumerate(clocks):
        for column, interval_s in enumerate(intervals):
            axes = panels[row_of_panels * columns + column]
            for place, case in enumerate(_CASES):
                rows = runs.where(case=case, **{_AT: interval_s})
                if rows:
                    drawn = _draw_shares(axes, look_of(case, _VARIANTS), rows, clock, place)
                    data += [{"app_2_interval_s": interval_s, "series": case, **one} for one in drawn]
            axes.set_xlabel(clock.label)
            if clock.log:
                axes.set_xscale("log")
                axes.set_xlim(_SINCE_S[0], _SINCE_S[-1])
                plain_log(axes.xaxis)
            else:
                axes.set_title(f"({_LETTERS[column]}) app_2 every {interval_s:g} s")
        panels[row_of_panels * columns].set_ylabel("share of UAVs that have turned")
    for axes, quantity, title in (
        (panels[columns - 1], "pdr", f"({_LETTERS[columns - 1]}) app_1 (1024 B every 1 s)"),
        (panels[-1], "reports.pdr", f"({_LETTERS[columns]}) app_2 (512 B)"),
    ):
        axes.set_title(title)
        data += _draw_delivery(axes, runs, quantity)
        axes.set_ylabel("share delivered")
        axes.tick_params(labelleft=True)
    panels[0].set_ylim(0, 1.05)
    legend_above(figure, panels[-1])
    return Drawing(figure, data)


def _seen(runs: Runs, quantity: Quantity, case: str, interval_s: float) -> dict[int, float]:
    return runs.per_seed(quantity, case=case, **{_AT: interval_s})


def _geometry(runs: Runs) -> Reason:
    flooded, papers = (_seen(runs, _wait_s, case, _SLOW_S) for case in ("flooding", "paper"))
    return Reason(
        "The instant is one of geometry: nobody turns before three UAVs have heard the same phone, which rests on "
        "where the survivors of a seed are and where the swarm comes from. The network adds to it what slots take.",
        [
            below("flooding: half turns so much later", flooded, _AT_ONCE_S, "s"),
            below("the paper's method: half turns so much later", papers, _SECONDS_S, "s"),
        ],
        _LIMIT_SET_AFTERWARDS,
    )


def _flooding_is_first(runs: Runs) -> Claim:
    ahead = differences(_seen(runs, _half_s, "paper", _SLOW_S), _seen(runs, _half_s, "flooding", _SLOW_S))
    flooded, papers = (_seen(runs, _by(_EARLY_S), case, _SLOW_S) for case in ("flooding", "paper"))
    return Claim(
        12,
        "At a packet every second flooding is faster at first: by 50-55 s about 38 UAVs approach, of the proposed "
        "method fewer than 5.",
        [
            above("half of the swarm has turned: the paper's method minus flooding", ahead, 0.0, "s"),
            above("flooding: UAVs by 55 s", flooded, _MANY, possible=_SWARM),
            below("the paper's method: UAVs by 55 s", papers, _FEW, possible=_SWARM),
        ],
        [_geometry(runs)],
    )


def _the_method_is_ahead_later(runs: Runs) -> Claim:
    flooding, paper = (_seen(runs, _at_end, case, _SLOW_S) for case in ("flooding", "paper"))
    flooded, told = (_seen(runs, _at_end_if_any, case, _SLOW_S) for case in ("flooding", "paper"))
    lead = differences(paper, flooding)
    nobody_left = Reason(
        "Under both the news reaches everyone in the end: whoever has not turned yet is told again by the next "
        "report, and nobody is left by whom the other could be ahead.",
        [
            above("flooding: UAVs at the end, if anybody turns", flooded, _NEARLY_ALL, possible=_SWARM),
            above("the paper's method: UAVs at the end, if anybody turns", told, _NEARLY_ALL, possible=_SWARM),
        ],
        "that a seed in which nobody turns (one of ten) does not count. With it the reason is open.",
    )
    return Claim(
        12,
        "Later the proposed method is ahead.",
        [above("UAVs that have turned by the end, the paper's method minus flooding", lead, 0.0)],
        [nobody_left],
    )


def _flooding_chokes(runs: Runs) -> Claim:
    def flooded(quantity: Quantity) -> dict[int, float]:
        return _seen(runs, quantity, "flooding", _FAST_S)

    few_send = Reason(
        "Only UAVs that hear a phone send app_2, and few do: the load stays far from what chokes a flood, and the "
        "news is there as soon as it can be.",
        [
            below("UAVs that have heard a phone", flooded(_heard), _MANY, possible=_SWARM),
            share_below("flooding: busy share of the air", flooded("air.busy"), _FREE),
            below("flooding: half turns so much later", flooded(_wait_s), _AT_ONCE_S, "s"),
        ],
        _LIMIT_SET_AFTERWARDS,
    )
    return Claim(
        12,
        "At a packet every 0.1 s nobody ever approaches under flooding.",
        [below("flooding: UAVs at the end", flooded(_at_end), 1.0, possible=_SWARM)],
        [few_send],
    )


def _change_of_half(what: str, left: Mapping[int, float], right: Mapping[int, float]) -> Statement:
    change_s = [abs(value) for value in differences(left, right)]
    return below(f"{what}change of the time when half have turned", change_s, _HARDLY_S, "s", possible=DISTANCE)


def _the_method_hardly_changes(runs: Runs) -> Claim:
    fast, slow = (_seen(runs, _half_s, "paper", at) for at in (_FAST_S, _SLOW_S))
    return Claim(12, "The proposed method hardly changes at 0.1 s.", [_change_of_half("", fast, slow)])


def _most_turn_in_the_window(runs: Runs) -> Claim:
    return Claim(
        12,
        "Under the proposed method most start within 50-70 s.",
        [
            share_above(
                f"app_2 every {interval_s:g} s: share of those that turn that do so within 50-70 s",
                _seen(runs, _in_window, "paper", interval_s),
                _MOST,
            )
            for interval_s in reversed(runs.levels(_INTERVAL))
        ],
        [_geometry(runs)],
    )


def _point_masses_do(flown: Mapping[int, float], simple: Mapping[int, float]) -> Claim:
    statement = _change_of_half("the paper's method, every 1 s: ", flown, simple)
    return Claim(0, "UAVs as point masses turn when those of the physics engine do.", [statement])


_CLAIMS: Final = (
    _flooding_is_first, _the_method_is_ahead_later, _flooding_chokes, _the_method_hardly_changes,
    _most_turn_in_the_window,
)  # fmt: skip


def claims(runs: Runs) -> list[Claim]:
    """The paper's claims and, if both engines were run, whether the fast model of flight changes anything."""
    found = [claim(runs) for claim in _CLAIMS]
    flown = _seen(runs, _half_s, _FLOWN, _SLOW_S)
    return [*found, _point_masses_do(flown, _seen(runs, _half_s, "paper", _SLOW_S))] if flown else found


FIGURE: Final = Recipe(
    "figure-12",
    "When UAVs turn towards survivors",
    "fig12",
    "45 UAVs fly in from a base over 16 survivors; everyone sends app_1 (1024 B every 1 s) to everyone, and whoever "
    "hears a phone reports it as app_2 (512 B every 1, 0.5 or 0.1 s). The paper's method: 4 clusters, flooding period "
    "5 s. fanet-mw: every node a head, flooding period 0.5 s, relays that count copies, repair. Above: mean share of "
    "the UAVs that have turned by then. Below: the same since three UAVs had heard the same phone, before which nobody "
    "can turn. Right: what arrives of app_1, and of app_2. Bars: 95 % of the mean over seeds, beside each other so "
    "that they can be told apart.",
    draw,
    claims,
)

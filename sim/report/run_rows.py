"""The figures of one run, as rows for people: with units, and without exponents."""

import statistics
from collections.abc import Iterator, Mapping
from typing import Any, Final

from sim.report.html import Rows
from sim.results.bounds import broken
from sim.results.mission import MISTAKEN_M

_LONG_MS: Final = 10_000
"""Times of at least this many milliseconds are said in seconds."""


def network(summary: Mapping[str, Any]) -> Rows:
    return Rows(("quantity", "value"), list(_network(summary)))


def mission(summary: Mapping[str, Any], *, confirms: bool) -> Rows:
    """What the mission achieved; `confirms` is true for a planned search, the only one in which UAVs confirm."""
    return Rows(("quantity", "value"), list(_mission(summary["mission"], confirms=confirms)))


def lateness(summary: Mapping[str, Any]) -> Rows:
    late = summary["lateness"]
    return Rows(
        ("late frames", "of", "share", "limit", "p50", "p99", "worst"),
        [[number(late["late_frames"]), number(late["frames"]), percent(late["share"]), percent(late["limit"]),
          *(milliseconds(late[key]) for key in ("p50_ms", "p99_ms", "max_ms"))]],
    )  # fmt: skip


def _network(summary: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    bound, air, delay = summary["bound"], summary["air"], summary["delay_ms"]
    yield "delivered, of packets x targets", percent(summary["pdr"])
    yield "delay, application to application: p50, p95, max", _times(delay, "p50", "p95", "max")
    if bound:
        yield from _bounds(bound)
        yield "greatest bound stated, greatest delay under one", _times(bound, "worst_ms", "observed_max_ms")
    if summary["reports"]["generated"]:
        yield "survivor reports delivered, of reports x targets", percent(summary["reports"]["pdr"])
        yield "their delay: p50, p95, max", _times(summary["reports"]["delay_ms"], "p50", "p95", "max")
    yield "time in which the air is busy", percent(air.get("busy"))
    yield "copies received, of copies in range", percent(air.get("pdr"))


def _bounds(bound: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    within, stated = bound["within_share"], bound.get("stated_share")
    if not stated or within is None:
        yield "packets x targets within the bound stated for each", percent(within)
        return
    yield "packets x targets for which a bound was stated", percent(stated)
    yield "of these, delivered within their bound", percent(min(1.0, within / stated))
    yield "of these, later than their bound or never; the rest had time left when the run ended", number(broken(bound))
    if bound.get("overtaken"):
        yield "late or lost likewise, because a fault overtook them", number(bound["overtaken"])


def _mission(found: Mapping[str, Any], *, confirms: bool) -> Iterator[tuple[str, str]]:
    people = found["survivors"]
    if people:
        yield "survivors detected: a UAV heard the phone", f"{found['detected']} of {people}"
        yield "survivors approached: a UAV changed course to them", f"{found['approached']} of {people}"
        yield "survivors reached: a UAV arrived at the place it believed", f"{found['reached']} of {people}"
        only = "" if confirms else " (UAVs confirm only in a planned search, mission.search)"
        confirmed = f"{found['confirmed']} of {people}{only}"
        yield f"survivors confirmed, within {MISTAKEN_M:g} m of the true place", confirmed
    if people and confirms:
        yield "mistaken: confirmed farther away than that", str(found["mistaken"])
        yield "confirmations taken back", str(found["reopened"])
        times = found["time_to_confirm_s"]
        if times:
            yield (
                "time to confirm: first, median, last",
                ", ".join(f"{number(value)} s" for value in (times[0], statistics.median(times), times[-1])),
            )
        if found["confirmed_error_m"] is not None:
            yield "median error of the places confirmed", f"{found['confirmed_error_m']:g} m"
    if found["coverage"] is not None:
        yield "area covered", percent(found["coverage"])
        if found.get("photographed") is not None:
            yield "area shown by cameras", percent(found["photographed"])
        late = found["covered_95_s"]
        yield "time until 95 % of the area were covered", "not within the run" if late is None else f"{number(late)} s"
    if found["connected"] is not None:
        yield "time in which all searching UAVs were connected", percent(found["connected"])
        if (by_distance := found.get("connected_by_distance") or 0.0) > found["connected"]:
            yield "the same without partitions and jammed areas", percent(by_distance)
        yield "time in which they would have been without any one of them", percent(found.get("biconnected"))
        for key, what in (
            ("cut_vertices", "UAVs whose loss would separate others: median, most"),
            ("diameter", "hops between two UAVs, at most: median, most"),
        ):
            if (usual := found.get(key)) is not None:
                yield what, f"{usual['p50']:g}, {usual['most']}"
    if found["nearest_m"]:
        yield (
            "distance to the nearest other UAV: least, 1st percentile, median",
            ", ".join(f"{number(found['nearest_m'][key])} m" for key in ("least", "p1", "p50")),
        )
    yield "contacts of UAVs with each other, the ground or an obstacle", str(found["collisions"])


def _times(values: Mapping[str, float | None], *keys: str) -> str:
    return ", ".join(milliseconds(values[key]) for key in keys)


def number(value: float | None) -> str:
    """A number with three significant digits, or all digits before the point."""
    if value is None:
        return "-"
    if value == int(value) or abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.3g}" if abs(value) >= 0.001 else f"{value:.6f}"


def milliseconds(value_ms: float | None) -> str:
    if value_ms is None:
        return "-"
    return f"{number(value_ms / 1000)} s" if value_ms >= _LONG_MS else f"{number(value_ms)} ms"


def percent(share: float | None) -> str:
    """A share in percent; all but everything is never said to be everything."""
    if share is None:
        return "-"
    if 0.9999 < share < 1:
        return "more than 99.99 %"
    return f"{100 * share:.2f}".rstrip("0").rstrip(".") + " %"

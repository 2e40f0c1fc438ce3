"""`fanet top`: a compact screen of a running swarm, one line per UAV, renewed every second."""

import contextlib
from collections.abc import Sequence
from typing import Final

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from fanet_mw.units import S
from fanet_mw.wire.survivors import is_person
from sim.observation.bus_feed import BusFeed, Paced
from sim.observation.swarm_state import SwarmState, UavNow

_RATE_HZ: Final = 4.0
_SILENT_S: Final = 5.0
_LOW_PERCENT: Final = 20
_MOST_NAMED: Final = 6
_CLUSTERED: Final = ("role", "head")
_HEADINGS: Final = (
    "UAV", *_CLUSTERED, "flight", "mission", "battery", "neighbors", "heard [s]", "queue", "received", "dropped",
)  # fmt: skip


def watch(feed: BusFeed, *, ended: Sequence[int], screens: int | None, console: Console) -> None:
    """Show the swarm until it is over, until somebody ends it, or for so many seconds of it."""
    state, paced, second, shown = SwarmState(feed.scenario), Paced(_RATE_HZ), -1, 0
    feed.listen(catches_up=True)
    with Live(console=console, auto_refresh=False) as live, contextlib.suppress(KeyboardInterrupt):
        while not ended and not feed.over and (screens is None or shown < screens):
            feed.pump(state)
            state.time_scale = feed.time_scale
            if feed.clock is not None and feed.now_ns() // S > second:
                second = feed.now_ns() // S
                shown += 1
                most = max(1, console.height - 5)
                live.update(screen(feed.names.swarm, state, feed.now_ns(), most=most), refresh=True)
            paced.wait()


def screen(swarm: str, state: SwarmState, now_ns: int, *, most: int) -> Group:
    """A line about the swarm, and a table of the UAVs; of more than `most` those that hear the fewest others."""
    links = state.neighbors()
    nodes = sorted(links.keys() & state.uavs.keys())
    if len(nodes) > most:
        nodes = sorted(sorted(nodes, key=lambda node: len(links[node]))[:most])
    clustered = any(uav.role for uav in state.uavs.values())
    shown = [name for name in _HEADINGS if clustered or name not in _CLUSTERED]
    table = Table(*shown, box=None, header_style="bold", padding=(0, 1, 0, 0))
    for node in nodes:
        cells = dict(zip(_HEADINGS, _row(node, state.uavs[node], state, links[node], now_ns), strict=True))
        table.add_row(*(cells[name] for name in shown))
    left = len(state.uavs) - len(nodes)
    more = [Text(f"{left} more, which hear more others, are not shown")] if left else []
    return Group(Text(_summary(swarm, state, now_ns), style="bold"), table, *more)


def _summary(swarm: str, state: SwarmState, now_ns: int) -> str:
    metrics = state.metrics()
    parts = [f"{swarm} {now_ns / S:.0f} of {state.scenario.duration_s:g} s", f"clock {state.time_scale:.3g}"]
    if (share := metrics["delivered_share"]) is not None:
        parts.append(f"delivered {share:.1%}")
    if (p95_ms := metrics["delay_p95_ms"]) is not None:
        parts.append(f"delay p95 {p95_ms:.0f} ms")
    if (bound_ms := metrics["bound_max_ms"]) is not None and (kept_ms := metrics["bounded_max_ms"]) is not None:
        parts.append(f"with a bound at most {kept_ms:.0f} ms ({bound_ms:.0f})")
    if (busy := metrics["airtime_lately_share"]) is not None:
        parts.append(f"air busy {busy:.0%}")
    if (found := state.parts()) is not None and len(found) > 1:
        parts.append(f"in {len(found)} parts")
    if (late := metrics["late_share"]) is not None:
        parts.append(f"late {late:.2%}")
    if state.survivors.now:
        parts.append(f"confirmed {metrics['confirmed']:.0f} of {metrics['survivors']:.0f}")
    return ", ".join(parts)


def _row(node: int, uav: UavNow, state: SwarmState, links: Sequence[int], now_ns: int) -> list[Text | str]:
    report = state.reports.get(node, {})
    silent_s = max(0.0, (now_ns - uav.heard_ns) / S)
    some = " ".join(map(str, links[:_MOST_NAMED])) + (" .." if len(links) > _MOST_NAMED else "")
    charge = uav.charge_percent
    low = charge is not None and charge < _LOW_PERCENT
    whom = "person" if is_person(uav.survivor) else str(uav.survivor)
    mission = uav.mission + (f" {whom}" if uav.survivor else "")
    return [
        str(node),
        uav.role or "-",
        str(uav.head or "-"),
        Text(uav.flight or "-", style="red" if uav.flight in ("fallen", "failsafe") else ""),
        mission or "-",
        Text("-" if charge is None else f"{charge} %", style="red" if low else ""),
        Text(f"{len(links)}: {some}" if links else "none", style="" if links else "red"),
        Text(f"{silent_s:.1f}", style="red" if silent_s > _SILENT_S else ""),
        str(report.get("waiting", "-")),
        str(uav.delivered),
        str(uav.drops.total()),
    ]

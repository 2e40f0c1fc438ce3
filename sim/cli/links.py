"""`fanet links`: a table of the links of a running swarm, renewed with each report of its emulator."""

import contextlib
import queue
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.live import Live
from rich.table import Table

from fanet_mw.bus import codecs
from fanet_mw.bus.link_stats import LOSSES, LinkRow, LinkStats
from fanet_mw.bus.topics import Topics
from fanet_mw.errors import MalformedFrameError
from fanet_mw.hosts.bus import Bus, config_of
from fanet_mw.units import S
from sim.bus.operator_commands import OPERATOR, find_swarm

_LOOK_S: Final = 0.5
"""The interval at which the router is checked while nothing arrives."""


def watch(
    endpoint: str,
    swarm: str | None,
    *,
    node: int | None,
    reports: int | None,
    console: Console,
    zenoh_config: Path | None = None,
) -> int:
    """Show links until interrupted, or until `reports` have come. Raises BusError without a router, else FanetError."""
    with Bus.join(endpoint, config_of(zenoh_config, OPERATOR)) as bus:
        name = swarm or find_swarm(bus)
        with _screen(console) as show, contextlib.suppress(KeyboardInterrupt):
            for number, stats in enumerate(_reports(bus, Topics(name)), start=1):
                rows = [row for row in stats.rows() if node is None or node in (row.src, row.dst)]
                most = max(1, console.height - 4) if console.is_terminal else len(rows)
                show(table(name, stats, rows, most=most))
                if number == reports:
                    break
    return 0


@contextlib.contextmanager
def _screen(console: Console) -> Iterator[Callable[[Table], None]]:
    """Shows one table in the place of another, or without a terminal one below the other."""
    if not console.is_terminal:
        yield console.print
        return
    with Live(console=console, auto_refresh=False) as live:
        yield lambda shown: live.update(shown, refresh=True)


def _reports(bus: Bus, names: Topics) -> Iterator[LinkStats]:
    """Link reports as they arrive, without malformed ones; raises BusError when the router is gone."""
    heard: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    bus.subscribe(names.radio_links, lambda _, payload: heard.put(payload))
    while True:
        try:
            messages = codecs.decode(heard.get(timeout=_LOOK_S))
        except MalformedFrameError:
            continue
        except queue.Empty:
            bus.check()
            continue
        yield from (message for message in messages if isinstance(message, LinkStats))


def table(swarm: str, stats: LinkStats, rows: Iterable[LinkRow], *, most: int) -> Table:
    """The `most` busiest links of a report."""
    busiest = sorted(rows, key=lambda row: (-row.copies, row.src, row.dst))
    more = f", {len(busiest) - most} more not shown" if len(busiest) > most else ""
    shown = Table(
        title=f"{swarm} at {stats.t_ns / S:.0f} s: {len(busiest)} links in {stats.span_ns / S:g} s{more}", box=None
    )
    for heading in ("from", "to", "copies", "received", "RSSI [dBm]"):
        shown.add_column(heading, justify="right")
    shown.add_column("lost")
    for row in busiest[:most]:
        lost = ", ".join(f"{reason} {count}" for reason, count in zip(LOSSES, row.lost, strict=True) if count)
        rssi = "-" if row.rssi_dbm is None else f"{row.rssi_dbm:.1f}"
        share = f"{row.received / max(1, row.copies):.0%}"
        shown.add_row(str(row.src), str(row.dst), str(row.copies), share, rssi, lost)
    return shown

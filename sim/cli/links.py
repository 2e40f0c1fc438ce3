"""`fanet links`: a table of the links of a running swarm, renewed with each report of its emulator."""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from pathlib import Path

from rich.console import Console
from rich.live import Live
from rich.table import Table

from fanet_mw.bus.link_stats import LOSSES, LinkRow, LinkStats
from fanet_mw.units import S
from sim.inspection.topics import Heard, decoded


def watch(
    endpoint: str,
    swarm: str | None,
    *,
    node: int | None,
    reports: int | None,
    console: Console,
    zenoh_config: Path | None,
) -> int:
    """Show links until interrupted, or until `reports` have come. Raises BusError without a router, else FanetError."""
    heard = Heard(endpoint, swarm, "radio/links", zenoh_config)
    told = (one for put in heard.puts() if put for one in decoded(put[2]) if isinstance(one, LinkStats))
    with _screen(console) as show, contextlib.suppress(KeyboardInterrupt):
        for stats in islice(told, reports):
            rows = [row for row in stats.rows() if node is None or node in (row.src, row.dst)]
            most = max(1, console.height - 4) if console.is_terminal else len(rows)
            show(table(heard.swarm, stats, rows, most=most))
    return 0


@contextlib.contextmanager
def _screen(console: Console) -> Iterator[Callable[[Table], None]]:
    """Shows one table in the place of another, or without a terminal one below the other."""
    if not console.is_terminal:
        yield console.print
        return
    with Live(console=console, auto_refresh=False) as live:
        yield lambda shown: live.update(shown, refresh=True)


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

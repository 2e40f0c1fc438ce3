"""Every reference case as one shipped scenario: ours beside ns-3.44 and theory. `python tests/validation/reference.py`.

The tables in `ns3/` were measured with ns-3.44: 802.11b, 11 Mb/s, long preamble, 1024 bytes, mean and standard
deviation over `runs` seeds. Ours agree within 0.02, 3 % of a throughput or 3 standard deviations, the widest. No
parameter of the model is fitted to them.
"""

import argparse
import csv
import json
import os
import statistics
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Final, NamedTuple

from sim import catalog
from sim.results import finish
from sim.run import simulate

HERE: Final = Path(__file__).parent
CHANNEL: Final = {"A": "range", "B": "log_distance"}
_SATURATED_S: Final = 0.001
Row = Mapping[str, str]


class Metric(NamedTuple):
    """One figure of a case."""

    key: str
    """Where it is in summary.json, dotted."""
    ns3: float
    sd: float
    relative: float = 0.0
    """Agreement in parts of the figure instead of 0.02."""
    theory: float | None = None

    @property
    def tolerance(self) -> float:
        return max(self.relative * self.ns3 if self.relative else 0.02, 3 * self.sd)


class Case(NamedTuple):
    """One row of a table."""

    name: str
    scenario: str
    settings: tuple[str, ...]
    metrics: tuple[Metric, ...]
    seeds: int


class Compared(NamedTuple):
    """A figure of ours beside its reference."""

    case: str
    metric: Metric
    ours: float

    @property
    def agrees(self) -> bool:
        return abs(self.ours - self.metric.ns3) <= self.metric.tolerance

    def line(self) -> str:
        m = self.metric
        theory = f"{m.theory:8.4f}" if m.theory is not None else " " * 8
        mark = "" if self.agrees else "  DIFFERS"
        return (
            f"{self.case:44} {m.key:20} {self.ours:8.4f} {m.ns3:8.4f} {theory} "
            f"{self.ours - m.ns3:+8.4f} {m.tolerance:7.4f}{mark}"
        )


HEAD: Final = f"{'case':44} {'figure':20} {'ours':>8} {'ns-3':>8} {'theory':>8} {'diff':>8} {'within':>7}"


# --- theory -------------------------------------------------------------------------------------------------------


def lone_transmitter(count: int, *, window: int = 32) -> float:
    """Saturated broadcast: a copy arrives if nobody else starts in its slot; tau = 2 / (W + 1) (Bianchi, 2000, eq. 8).

    Stations that draw 0 and go again at once are left out (Ma and Chen, IEEE Comm. Letters 2007, treat them), so
    that it is too low for many stations.
    """
    return float((1 - 2 / (window + 1)) ** (count - 1))


def bianchi(
    count: int, *, success_us: float, collision_us: float, payload_bytes: int, window: int = 32, slot_us: float = 20
) -> tuple[float, float]:
    """Saturation throughput [Mb/s] and failure probability of an attempt (Bianchi, JSAC 18(3), 2000; 7 attempts).

    The window doubles up to 1024; a frame leaves after the seventh failure.
    """
    windows = [min(window << stage, 1024) for stage in range(7)]

    def tau(failure: float) -> float:
        weights = [failure**stage for stage in range(7)]
        return sum(weights) / sum(w * (window + 1) / 2 for w, window in zip(weights, windows, strict=True))

    low, high = 0.0, 1.0
    for _ in range(60):
        failure = (low + high) / 2
        low, high = (failure, high) if 1 - (1 - tau(failure)) ** (count - 1) > failure else (low, failure)
    attempt = tau(failure)
    idle = (1 - attempt) ** count
    success = count * attempt * (1 - attempt) ** (count - 1)
    mean_us = idle * slot_us + success * success_us + (1 - idle - success) * collision_us
    return success * 8 * payload_bytes / mean_us, failure


# --- the tables ---------------------------------------------------------------------------------------------------


def _rows(name: str) -> list[Row]:
    with (HERE / "ns3" / f"{name}.csv").open(encoding="ascii") as file:
        return list(csv.DictReader(file))


def _figure(row: Row, column: str, key: str, **more: Any) -> Metric:
    return Metric(key, float(row[column]), float(row.get(f"{column}_sd") or 0), **more)


def _broadcast(row: Row) -> Case:
    count, interval_s = int(row["n"]), float(row["interval"])
    saturated = interval_s <= _SATURATED_S and count > 2
    theory = lone_transmitter(count) if saturated and row["chan"] == "A" else None
    return Case(
        f"broadcast {row['chan']} n={count} every {interval_s:g} s",
        "contention_broadcast",
        (
            f"nodes.count={count}", f"traffic.interval_s={interval_s}", f"radio.channel={CHANNEL[row['chan']]}",
            f"duration_s={4 if interval_s < 0.02 else 20}",
        ),
        (_figure(row, "pdr_air", "air.pdr", theory=theory), _figure(row, "busy", "air.busy")),
        seeds=5 if interval_s >= 0.02 else 2,
    )  # fmt: skip


def _unicast(row: Row) -> Case:
    sources, interval_s = int(row["nsrc"]), float(row["interval"])
    return Case(
        f"unicast {sources} senders every {interval_s:g} s",
        "contention_unicast",
        (f"nodes.count={sources + 1}", "traffic.arrivals=cbr", f"traffic.interval_s={interval_s}", "duration_s=20"),
        (_figure(row, "pdr", "pdr"), _figure(row, "mean_retries", "air.mean_retries", relative=0.05)),
        seeds=3,
    )


def _saturated(row: Row) -> Case:
    sources = int(row["nsrc"])
    mbps, failure = bianchi(sources, success_us=984 + 10 + 203 + 50, collision_us=984 + 50, payload_bytes=1024)
    return Case(
        f"unicast {sources} senders saturated",
        "contention_unicast",
        (f"nodes.count={sources + 1}", "traffic.arrivals=saturated", "duration_s=20"),
        (
            _figure(row, "thr_mbps", "air.throughput_mbps", relative=0.03, theory=mbps),
            _figure(row, "p_attempt_fail", "air.attempt_failure", theory=failure),
        ),
        seeds=2,
    )


def _hidden(row: Row) -> Case:
    unicast, interval_s = row["cast"] == "uc", float(row["interval"])
    settings = (f"traffic.arrivals={row['arr']}", f"traffic.interval_s={interval_s}")
    metrics = [_figure(row, "pdr", "pdr")]
    if unicast:
        metrics.append(_figure(row, "mean_retries", "air.mean_retries", relative=0.05))
    else:
        settings = (*settings, "traffic.destination=all")
    kind = "unicast" if unicast else "broadcast"
    return Case(
        f"hidden terminals {kind} {row['arr']} every {interval_s:g} s", "hidden_terminal", settings, tuple(metrics),
        seeds=3 if row["arr"] == "poisson" else 20,
    )  # fmt: skip


def _flooding(row: Row) -> Case:
    sources, interval_s = int(row["nsrc"]), float(row["interval"])
    return Case(
        f"flooding 9 x 5, {sources} sources every {interval_s:g} s",
        "flooding",
        (
            f"traffic.sources={sources}",
            f"traffic.interval_s={interval_s}",
            f"routing.jitter_ms={1000 * float(row['jitter']):g}",
        ),
        (_figure(row, "pdr", "pdr"), _figure(row, "busy", "air.busy")),
        seeds=5 if sources < 20 else 2,
    )


_TABLES: Final[Mapping[str, Callable[[Row], Case]]] = {
    "broadcast_contention": _broadcast,
    "unicast_load": _unicast,
    "unicast_saturated": _saturated,
    "hidden_terminal": _hidden,
    "flooding_grid": _flooding,
}


def cases() -> list[Case]:
    """Every row of every table."""
    return [make(row) for name, make in _TABLES.items() for row in _rows(name)]


# --- running ------------------------------------------------------------------------------------------------------


def measure(case: Case) -> list[Compared]:
    """Run a case with its seeds and compare the means."""
    summaries = [summary_of(case.scenario, case.settings, seed) for seed in range(1, case.seeds + 1)]
    return [
        Compared(case.name, metric, statistics.fmean(at(summary, metric.key) for summary in summaries))
        for metric in case.metrics
    ]


def summary_of(scenario: str, settings: Iterable[str], seed: int) -> dict[str, Any]:
    """The summary of one run of a shipped scenario."""
    return finish(simulate(catalog.find(scenario, [*settings, f"seed={seed}"])), out=None)


def at(summary: Mapping[str, Any], key: str) -> float:
    """The figure under a dotted key."""
    value: Any = summary
    for part in key.split("."):
        value = value[part]
    return float(value or 0.0)


def compare_all(wanted: list[Case], jobs: int) -> Iterator[Compared]:
    """In order, `jobs` at a time."""
    with ProcessPoolExecutor(jobs) as pool:
        for compared in pool.map(measure, wanted):
            yield from compared


def main() -> int:
    """Print the table; exit code 1 when a figure differs."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--only", default="", help="only cases whose name contains this")
    flags.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes (%(default)s)")
    flags.add_argument("--json", type=Path, help="write the figures to this file, too")
    given = flags.parse_args()
    print(HEAD)
    done = []
    for compared in compare_all([case for case in cases() if given.only in case.name], given.jobs):
        print(compared.line(), flush=True)
        done.append(compared)
    differ = sum(not compared.agrees for compared in done)
    print(f"{len(done) - differ} of {len(done)} figures agree")
    if given.json:
        given.json.write_text(json.dumps([{"case": c.case, "ours": c.ours, **c.metric._asdict()} for c in done]))
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())

"""Every reference case as one shipped scenario: ours beside ns-3.44 and theory. `python tests/validation/reference.py`.

The tables in `ns3/` were measured with ns-3.44: 802.11b, 11 Mb/s, long preamble, 1024 bytes, mean and standard
deviation over `runs` seeds. No parameter of the model is fitted to them. Each case runs twice here: with
`radio.access = "ns3"`, which is what agrees or not, and with `"standard"`, which stands beside it.

A figure agrees within `Metric.exact` (0.02 of a share, or half of what is lost, if that is less; 3 % of a throughput or
of busy time, 5 % of retries) or 3 standard errors of the difference of the means, whichever is wider. The errors are
those of ns-3's runs, so that no scatter of ours can excuse us. A figure says something only if it can disagree: one
whose tolerance reaches 0, or 1 if it is a share, would agree with a medium that carries nothing, or loses nothing, too,
and is not counted.
"""

import argparse
import csv
import json
import math
import os
import statistics
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Final, NamedTuple

from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

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
    runs: int
    """Of ns-3, behind its mean and standard deviation."""
    relative: float = 0.0
    """Agreement in parts of the figure instead of 0.02."""
    theory: float | None = None

    @property
    def exact(self) -> float:
        """How near it must come if neither side scatters."""
        if self.relative:
            return self.relative * self.ns3
        rare = min(self.ns3, 1 - self.ns3)
        return min(0.02, rare / 2) if rare > 0 else 0.02

    def tolerance(self, seeds: int) -> float:
        """How near it must come as a mean over so many runs of ours."""
        return max(self.exact, 3 * self.sd * math.sqrt(1 / self.runs + 1 / seeds))


class Case(NamedTuple):
    """One row of a table."""

    name: str
    scenario: str
    settings: tuple[str, ...]
    metrics: tuple[Metric, ...]
    seeds: int


class Compared(NamedTuple):
    """A figure of ours, as a mean over so many runs, beside its reference."""

    case: str
    metric: Metric
    seeds: int
    ours: float
    """With `radio.access = "ns3"`."""
    standard: float
    """With `radio.access = "standard"`."""

    @property
    def tolerance(self) -> float:
        return self.metric.tolerance(self.seeds)

    @property
    def agrees(self) -> bool:
        return self._near(self.ours)

    @property
    def standard_agrees(self) -> bool:
        return self._near(self.standard)

    @property
    def can_disagree(self) -> bool:
        """Whether neither 0 nor, of a share, 1 would agree."""
        most = 1.0 if self.metric.key in _SHARES else math.inf
        return not self._near(0.0) and not self._near(most)

    def _near(self, figure: float) -> bool:
        return abs(figure - self.metric.ns3) <= self.tolerance

    def line(self) -> str:
        m = self.metric
        theory = f"{m.theory:8.4f}" if m.theory is not None else " " * 8
        marks = [
            "" if self.agrees else "  DIFFERS",
            "" if self.standard_agrees else "  (standard differs)",
            "" if self.can_disagree else "  (cannot disagree)",
        ]
        return (
            f"{self.case:50} {m.key:20} {self.ours:8.4f} {m.ns3:8.4f} {theory} {self.ours - m.ns3:+8.4f} "
            f"{self.tolerance:7.4f} {self.standard:8.4f} {self.standard - m.ns3:+8.4f}{''.join(marks)}"
        )


_SHARES: Final = ("pdr", "air.pdr", "air.busy", "air.attempt_failure")
HEAD: Final = (
    f"{'case':50} {'figure':20} {'ours':>8} {'ns-3':>8} {'theory':>8} {'diff':>8} {'within':>7} "
    f"{'standard':>8} {'diff':>8}"
)


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
    return Metric(key, float(row[column]), float(row.get(f"{column}_sd") or 0), int(row["runs"]), **more)


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
        (_figure(row, "pdr_air", "air.pdr", theory=theory), _figure(row, "busy", "air.busy", relative=0.03)),
        seeds=5 if interval_s >= 0.02 else 2,
    )  # fmt: skip


def _unicast(row: Row) -> Case:
    sources, interval_s = int(row["nsrc"]), float(row["interval"])
    return Case(
        f"unicast {sources} senders every {interval_s:g} s",
        "contention_unicast",
        (f"nodes.count={sources + 1}", "traffic.arrivals=cbr", f"traffic.interval_s={interval_s}", "duration_s=10"),
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
    settings = (
        f"traffic.arrivals={row['arr']}",
        f"traffic.interval_s={interval_s}",
        f"duration_s={row['seconds']}",
    )
    metrics = [_figure(row, "pdr", "pdr")]
    if unicast:
        metrics.append(_figure(row, "mean_retries", "air.mean_retries", relative=0.05))
    else:
        settings = (*settings, "traffic.destination=all")
    kind = "unicast" if unicast else "broadcast"
    return Case(
        f"hidden terminals {kind} {row['arr']} every {interval_s:g} s", "hidden_terminal", settings, tuple(metrics),
        seeds=10 if row["arr"] == "poisson" else 500,
    )  # fmt: skip


def _flooding(row: Row) -> Case:
    sources, interval_s = int(row["nsrc"]), float(row["interval"])
    return Case(
        f"flooding 9 x 5, {sources} sources every {interval_s:g} s",
        "flooding",
        (
            f"traffic.sources={list(range(2, sources + 2))}",
            f"traffic.interval_s={interval_s}",
            f"routing.jitter_ms={1000 * float(row['jitter']):g}",
        ),
        (_figure(row, "pdr", "pdr"), _figure(row, "busy", "air.busy", relative=0.03)),
        seeds=20 if sources < 20 else 2,
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
    keys = [metric.key for metric in case.metrics]
    ours, standard = means(case, keys, access="ns3"), means(case, keys, access="standard")
    rows = zip(case.metrics, ours, standard, strict=True)
    return [Compared(case.name, metric, case.seeds, *pair) for metric, *pair in rows]


def means(case: Case, keys: Sequence[str], *, access: str) -> list[float]:
    """The figures of a case over its seeds, with a way of access."""
    settings = (*case.settings, f"radio.access={access}")
    summaries = [summary_of(case.scenario, settings, seed) for seed in range(1, case.seeds + 1)]
    return [statistics.fmean(at(summary, key) for summary in summaries) for key in keys]


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
    print(verdict(done))
    if given.json:
        rows = [{"case": c.case, "ours": c.ours, "standard": c.standard, **c.metric._asdict()} for c in done]
        given.json.write_text(json.dumps(rows))
    return 0 if all(compared.agrees for compared in done) else 1


def verdict(done: Sequence[Compared]) -> str:
    """How many figures agree, of those that can disagree; the others are counted by themselves."""
    telling, idle = [c for c in done if c.can_disagree], [c for c in done if not c.can_disagree]
    return (
        f"{sum(c.agrees for c in telling)} of {len(telling)} figures that can disagree agree with ns-3; "
        f"with the standard's access {sum(c.standard_agrees for c in telling)}.\n"
        f"Of {len(idle)} more, whose tolerance reaches 0 or 1, {sum(c.agrees for c in idle)} agree; "
        f"with the standard's access {sum(c.standard_agrees for c in idle)}."
    )


if __name__ == "__main__":
    sys.exit(main())

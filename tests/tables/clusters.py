"""Measured tables of clusters and relays. Each costs minutes."""

import statistics
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from typing import Any, Final
from unittest import mock

from fanet_mw.routing.clustered.roles.failure_detectors import NeighborFailureDetector
from tests.benchmarks import moving_swarm, relay_rules
from tests.tables.markdown import Rows
from tests.tables.summaries import summarized

_SEEDS: Final = (1, 2, 3)
_MOBILITIES: Final = {"static": "at rest", "formation": "formation", "random_waypoint": "random waypoint"}
_UAVS: Final = (45, 100, 200, 500, 1000)
_NO_REPORTS: Final = mock.patch.object(NeighborFailureDetector, "find_suspect", return_value=None)
_TOGETHER: Final = (
    ("all", 1.0), ("all", 0.2),
)  # fmt: skip


def new_clusters() -> Rows:
    """What it is worth to a swarm that moves to assign its clusters anew."""
    rows = [["relay, mobility, m/s", "PDR, assigned once", "PDR, anew", "epochs, once / anew"]]
    for relay, model, speed_m_s in moving_swarm.cases():
        once, anew = (
            [
                moving_swarm.measured(moving_swarm.scenario(relay, model, speed_m_s, reassign_s=reassign_s, seed=seed))
                for seed in _SEEDS
            ]
            for reassign_s in (0.0, 10.0)
        )
        pdr = [f"{statistics.mean(run.pdr for run in runs):.3f}" for runs in (once, anew)]
        epochs = " / ".join(f"{statistics.mean(run.epochs for run in runs):.1f}" for runs in (once, anew))
        speed = f", {speed_m_s:g}" if speed_m_s else ""
        rows.append([f"`{relay}`, {_MOBILITIES[model]}{speed}", *pdr, epochs])
    return rows


def silent_neighbors() -> Rows:
    """What reports of silent neighbors do to a swarm that moves, where most of those neighbors flew away."""
    rows = [["speed", "silent neighbors are", "PDR", "epochs in 90 s", "control frames per second and node"]]
    for speed_m_s in (5.0, 10.0):
        for reported in (False, True):
            with nullcontext() if reported else _NO_REPORTS:
                found = [
                    moving_swarm.measured(
                        moving_swarm.scenario("scheduled", "random_waypoint", speed_m_s, reassign_s=10, seed=seed)
                    )
                    for seed in _SEEDS
                ]
            rows.append([
                f"{speed_m_s:g} m/s",
                "reported" if reported else "not reported",
                f"{statistics.mean(run.pdr for run in found):.3f}",
                f"{statistics.mean(run.epochs for run in found):.1f}",
                f"{statistics.mean(run.control for run in found):.1f}",
            ])  # fmt: skip
    return rows


def rules() -> Rows:
    """Every rule of `clusters.relay`, in a grid and in a dense swarm."""
    swarms = [*relay_rules.SWARMS]
    columns = [f"{swarm}: {what}" for swarm in swarms for what in ("PDR", "frames", "delay mean / p95 / max [ms]")]
    rows = [["rule", *columns]]
    for rule in relay_rules.RULES:
        cells: list[str] = []
        for swarm in swarms:
            cells += _cells_of_rule(relay_rules.measured(rule, swarm, seconds=40))
        rows.append([f"`{rule}`", *cells])
    return rows


def _cells_of_rule(found: Sequence[dict[str, Any]]) -> Iterator[str]:
    yield ", ".join(f"{run['pdr']:.4f}" for run in found)
    yield f"{statistics.mean(run['frames']['sent'] / run['generated'] for run in found):.1f}"
    yield " / ".join(f"{statistics.mean(run['delay_ms'][key] for run in found):.0f}" for key in ("mean", "p95", "max"))


def together() -> Rows:
    """Packets of 64 B alone in their frames, and several in each."""
    what = "PDR, frames, delay mean / p95 [ms]"
    rows = [["rule, interval", f"alone: {what}", f"together: {what}"]]
    for rule, interval_s in _TOGETHER:
        keys = [
            "duration_s=27", "traffic.payload_bytes=64", "radio.max_frame_bytes=1024", f"clusters.relay={rule}",
            f"traffic.interval_s={interval_s}",
            *(("clusters.count=8", "clusters.flooding_period_s=1") if rule == "all" else ()),
        ]  # fmt: skip
        found = [summarized("clusters", *keys, f"routing.aggregate={shared}") for shared in ("false", "true")]
        rows.append([f"`{rule}`, {interval_s:g} s", *(_alone_or_together(run) for run in found)])
    return rows


def _alone_or_together(run: dict[str, Any]) -> str:
    delay = run["delay_ms"]
    return f"{run['pdr']:.3f}, {run['frames']['sent']:,}, {delay['mean']:.0f} / {delay['p95']:.0f}"

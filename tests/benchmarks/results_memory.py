"""Memory and CPU of the launcher for the result of a long run: `python tests/benchmarks/results_memory.py [MINUTES]`.

What the agents of `rescue` tell of their traffic (every packet delivered to all) is put to a collector as fast as it
takes it; then the result is computed and written, as at the end of a run in real time.
"""

import resource
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import TraceBatch
from fanet_mw.bus.topics import Topics
from fanet_mw.hosts.bus import OnSample
from fanet_mw.trace import Delivered, Generated, LetOut, Record
from fanet_mw.units import MS, S
from sim.results.files import finish
from sim.run.collecting.collector import Collector
from sim.scenarios import catalog

NAMES = Topics("rescue")
_PAGE_MB = resource.getpagesize() / 1e6


def rss_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * _PAGE_MB


def main(minutes: float) -> None:
    scenario = catalog.find("rescue", [f"duration_s={60 * minutes}"])
    hear: dict[str, OnSample] = {}
    now_ns = 0
    deliveries = 0
    with tempfile.TemporaryDirectory() as folder:
        collector = Collector(
            scenario, lambda expression, on_sample: hear.__setitem__(expression, on_sample), NAMES,
            now_ns=lambda: now_ns, folder=None,
        )  # fmt: skip
        with closing(collector):
            put, nodes = hear[NAMES.all_traces], scenario.node_ids
            before_mb, began_s = rss_mb(), time.process_time()
            for seq in range(int(60 * minutes) - 10):
                now_ns = (seq + 6) * S
                for node in nodes:
                    t_ns = now_ns + node * MS
                    records: list[Record] = [Generated(t_ns, node, seq, "traffic", 1024), LetOut(t_ns + MS, node, seq)]
                    records += [
                        Delivered(now_ns + origin * MS + (delay := (50 + (seq + node) % 400) * MS), node, origin, seq,
                                  delay, 2, 20 * MS)
                        for origin in nodes
                        if origin != node
                    ]  # fmt: skip
                    deliveries += len(records) - 2
                    put(NAMES.trace(f"agent-{node}"), codecs.encode([TraceBatch(tuple(records))]))
            collected_mb, collected_s = rss_mb(), time.process_time()
            outcome = collector.outcome(wall_s=60 * minutes)
        summary = finish(outcome, out=Path(folder) / "out")
    peak_mb, ended_s = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6, time.process_time()
    assert summary["delivered"] == deliveries, "all of them were taken"
    million = deliveries / 1e6
    print(
        f"{minutes:g} minutes, {deliveries} deliveries: {before_mb:.0f} MB, {collected_mb - before_mb:+.1f} MB "
        f"and {collected_s - began_s:.0f} s of CPU while collecting; for the result {peak_mb - collected_mb:+.0f} MB "
        f"({(peak_mb - collected_mb) / million:.0f} MB per 10^6) and {ended_s - collected_s:.0f} s of CPU"
    )


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10)

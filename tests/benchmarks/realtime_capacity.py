"""How many UAV processes one machine holds in real time: `python tests/benchmarks/realtime_capacity.py [COUNT ...]`.

Scenario rescue-paper, 100 s, with more and more UAVs. Late frames are those that reach the medium after the instant
they asked for; the mark is 0.1 %. What is used up is shown beside it: CPU of all processes over wall time and cores.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

_SECONDS = 100


def measure(count: int) -> tuple[dict[str, Any], dict[str, Any]]:
    with tempfile.TemporaryDirectory() as folder:
        command = [
            sys.executable, "-m", "sim.cli.app", "launch", "rescue-paper", "--json", "--out", folder,
            "--set", f"nodes.count={count}", "--set", f"duration_s={_SECONDS}",
        ]  # fmt: skip
        subprocess.run(command, capture_output=True, check=False, timeout=300)
        summary = json.loads((Path(folder) / "summary.json").read_text())
        return summary, json.loads((Path(folder) / "reports.json").read_text())


def main(counts: list[int]) -> None:
    cores = os.cpu_count() or 1
    print("UAVs  up s  frames/s  late %   p99 ms  worst ms  PDR    CPU of all cores: agents, emulator, world")
    for count in counts:
        summary, reports = measure(count)
        late = summary["lateness"]
        cpu_s = {name: report.get("host", {}).get("cpu_s", 0.0) for name, report in reports.items()}
        agents_s = sum(used for name, used in cpu_s.items() if name.startswith("agent-"))
        shares = [f"{100 * used / (_SECONDS * cores):.0f} %" for used in (agents_s, cpu_s["emulator"], cpu_s["world"])]
        print(
            f"{count:4}  {summary['processes']['ready_s']:4.1f}  {summary['frames']['sent'] / _SECONDS:8.0f}  "
            f"{100 * late['share']:6.3f}  {late['p99_ms']:6.1f}  {late['max_ms']:8.1f}  {summary['pdr']:.3f}  "
            f"{', '.join(shares)}",
            flush=True,
        )


if __name__ == "__main__":
    main([int(arg) for arg in sys.argv[1:]] or [30, 45, 60, 80])

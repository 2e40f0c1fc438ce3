"""Slopes of memory, files and threads of a long run.

`python tests/benchmarks/soak.py SCENARIO SECONDS FOLDER [KEY=VALUE ...]` runs the scenario as processes, looks at each
of them in /proc every 10 s, and appends what it finds to `FOLDER/samples.csv`. The slopes are straight lines through
the samples after the first tenth of the run, and again through those of its second half: what fills up once (caches,
bounded stores) shows in the first slope and not in the second. `python tests/benchmarks/soak.py FOLDER` prints the
table of a run that is over, or still going on. Linux only.
"""

import csv
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from statistics import fmean, linear_regression

_EVERY_S = 10.0
_SETTLED = 0.1
"""The share of the run that is left out at its start: imports, joins and first allocations are no slope."""
_PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6
_TICKS_PER_S = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True)
class Sample:
    """What /proc says of one process at one time."""

    t_s: float
    name: str
    pid: int
    rss_mb: float
    own_mb: float
    """The pages that no other process shares: processes forked from one server share the rest of the RSS."""
    files: int
    threads: int
    unlinked_mb: float
    """The size of open files without a name: what the launcher keeps on disk until the run is over."""
    cpu_s: float


def descendants(root: int) -> Iterator[int]:
    """A process and all that it started, directly or not."""
    children: dict[int, list[int]] = defaultdict(list)
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                stat = (folder / "stat").read_text()
            except OSError:
                continue
            children[int(stat.rpartition(")")[2].split()[1])].append(int(folder.name))
    pending = [root]
    while pending:
        pid = pending.pop()
        yield pid
        pending.extend(children[pid])


def sample(pid: int, *, name: str | None, t_s: float) -> Sample:
    """Look at a process; raises OSError when it is gone."""
    folder = Path("/proc") / str(pid)
    stat = (folder / "stat").read_text().rpartition(")")[2].split()
    rollup = dict(line.split(":") for line in (folder / "smaps_rollup").read_text().splitlines()[1:])
    own_kb = sum(int(rollup[key].split()[0]) for key in ("Private_Clean", "Private_Dirty"))
    unlinked = 0
    handles = list((folder / "fd").iterdir())
    for handle in handles:
        try:
            if handle.readlink().name.endswith("(deleted)"):
                unlinked += handle.stat().st_size
        except OSError:
            continue
    return Sample(
        t_s=round(t_s, 1),
        name=name or (folder / "comm").read_text().strip(),
        pid=pid,
        rss_mb=round(int(stat[21]) * _PAGE_MB, 3),
        own_mb=round(own_kb * 1024 / 1e6, 3),
        files=len(handles),
        threads=int(stat[17]),
        unlinked_mb=round(unlinked / 1e6, 3),
        cpu_s=(int(stat[11]) + int(stat[12])) / _TICKS_PER_S,
    )


def observe(launcher: subprocess.Popen[bytes], path: Path) -> None:
    """Append samples of all processes until the launcher ends."""
    began_s = time.monotonic()
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Sample)])
        writer.writeheader()
        while launcher.poll() is None:
            t_s = time.monotonic() - began_s
            for pid in descendants(launcher.pid):
                try:
                    row = sample(pid, name="launcher" if pid == launcher.pid else None, t_s=t_s)
                except (OSError, ValueError):
                    continue  # it ended between two looks
                writer.writerow(asdict(row))
            file.flush()
            time.sleep(max(0.0, _EVERY_S - (time.monotonic() - began_s - t_s)))


def read(path: Path) -> list[Sample]:
    kinds = {field.name: field.type for field in fields(Sample)}
    with path.open(newline="") as file:
        return [Sample(**{key: kinds[key](text) for key, text in row.items()}) for row in csv.DictReader(file)]  # type: ignore[operator]


def table(samples: list[Sample], *, until_s: float) -> Iterator[str]:
    """A row for each part of the swarm; the agents together, and the one that grows fastest."""
    yield "| process | RSS [MB] | slope [MB/h] | of the second half | own pages [MB/h] | files | threads |"
    yield "|---|---|---|---|---|---|---|"
    by_name: dict[str, list[Sample]] = defaultdict(list)
    for one in samples:
        if _SETTLED * until_s <= one.t_s <= until_s:
            by_name[one.name].append(one)
    agents = {name: rows for name, rows in by_name.items() if name.startswith("agent-") and len(rows) > 2}
    for name in ("launcher", "emulator", "world"):
        yield _row(name, [by_name[name]], until_s)
    fastest = max(agents, key=lambda name: _slope(agents[name], "rss_mb"))
    yield _row(f"the {fastest.replace('-', ' ')}, which grows fastest", [agents[fastest]], until_s)
    yield _row(f"mean of {len(agents)} agents", list(agents.values()), until_s)


def _row(name: str, processes: list[list[Sample]], until_s: float) -> str:
    """Means over some processes: figures at the start and at the end, and slopes."""

    def ends(key: str, digits: int) -> str:
        start, end = (fmean(getattr(rows[at], key) for rows in processes) for at in (0, -1))
        return f"{start:.{digits}f} to {end:.{digits}f}"

    halves = [[row for row in rows if row.t_s >= until_s / 2] for rows in processes]
    slopes = [
        fmean(_slope(rows, key) for rows in chosen)
        for chosen, key in ((processes, "rss_mb"), (halves, "rss_mb"), (processes, "own_mb"))
    ]
    cells = [name, ends("rss_mb", 1), *(f"{slope:+.1f}" for slope in slopes), ends("files", 0), ends("threads", 0)]
    return f"| {' | '.join(cells)} |"


def _slope(rows: list[Sample], key: str) -> float:
    """The slope of a figure, per hour."""
    if len(rows) < 2:
        return float("nan")
    return 3600 * linear_regression([row.t_s for row in rows], [getattr(row, key) for row in rows]).slope


def show(folder: Path) -> None:
    samples = read(folder / "samples.csv")
    agents_until_s = max(one.t_s for one in samples if one.name.startswith("agent-"))
    for line in table(samples, until_s=agents_until_s):
        print(line)
    launcher = [one for one in samples if one.name == "launcher"]
    print(
        f"{agents_until_s:.0f} s. On disk at the launcher: {max(one.unlinked_mb for one in launcher):.1f} MB; memory "
        f"of the launcher while it computes the result: at most {max(one.rss_mb for one in launcher):.0f} MB."
    )
    summary = folder / "result" / "summary.json"
    if summary.exists():
        figures = json.loads(summary.read_text())
        print({key: figures.get(key) for key in ("valid", "pdr", "lateness", "frames", "heard")})


def main(arguments: list[str]) -> None:
    if len(arguments) == 1:
        show(Path(arguments[0]))
        return
    scenario, seconds, folder, *keys = arguments
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    command = [
        sys.executable,
        "-m",
        "sim.cli.app",
        "launch",
        scenario,
        "--duration",
        seconds,
        "--out",
        str(out / "result"),
    ]
    with (out / "launcher.log").open("wb") as log:
        launcher = subprocess.Popen([*command, *(["--set", *keys] if keys else [])], stdout=log, stderr=log)
        observe(launcher, out / "samples.csv")
    show(out)


if __name__ == "__main__":
    main(sys.argv[1:])

"""Scenarios, options, folders of runs and of sweeps with one thing changed, as somebody else might hand them over.

    python tests/fuzz/foreign.py INPUTS [FIRST SEED]        10,000 inputs take some ten minutes

Each input is the seed of everything drawn for it. What is read ends as a value or as a ConfigError that `fanet` prints
in few short lines, within 20 s of this processor's time (whatever else it does meanwhile), and nothing outside of the
folder is made, changed or removed.
"""

import contextlib
import io
import json
import os
import re
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from random import Random
from types import FrameType
from typing import Any, Final, NamedTuple

from fanet_mw.errors import ConfigError
from sim.cli.app import refused
from sim.recording import contents
from sim.recording.from_result import write_mcap
from sim.recording.tables import write_csv, write_parquet
from sim.recording.tracks import write_gpx
from sim.report import page, replay_page
from sim.report.run_records import SHOWN, RunRecords
from sim.results.files import finish
from sim.results.replay import Replay
from sim.results.result import load_result
from sim.results.run_folder import RunFolder
from sim.results.run_table import read
from sim.run.virtual import simulate
from sim.scenarios import catalog
from sim.sweep.one_run import Finished
from sim.sweep.spec import Sweep
from sim.sweep.store import Store
from sim.sweep.tasks import tasks_of
from sim.sweep.whole_sweep import RemainingRuns
from sim.world.possible_world import require_possible

LONGEST_S: Final = 20
MOST_LINES: Final = 20
LONGEST_LINE: Final = 1_000
NAMES: Final = ("quick", "clusters", "rescue", "town", "clocks")
VALUES: Final = (
    "true", "-1", "0", "1e308", "nan", "inf", "9" * 400, "9" * 5_000, '""', '"x"', '"../../x"', '"/dev/zero"',
    '"a\\u0000b"',
    '"os:system"', '"sys:exit"', "[]", "{}", "[[1]]", "[" * 600 + "]" * 600, "1979-05-27", '"' + "x" * 70_000 + '"',
    '"\\u001b[31m"', "0x7fffffffffffffff", "-9223372036854775808", "1.5", '"1 s"', '"[red]"', "[1, 2, 3]", "{a = 1}",
)  # fmt: skip
PLAIN: Final = (
    True, False, None, -1, 0, 10**30, 2**63 - 1, 1e308, float("nan"), float("inf"), "", "x", "../../x", "/etc/passwd",
    "a\0b",
    "x" * 100_000, [], {}, [[]], {"a": {}}, "no", 1, "1", -0.0, [1] * 1_000,
)  # fmt: skip


class Wrong(NamedTuple):
    """An input that was not answered as it should be."""

    seed: int
    kind: str
    what: str


class Corpus(NamedTuple):
    """What is changed: the texts of scenarios, a run's folder and a sweep's folder."""

    scenarios: list[str]
    run: Path
    sweep: Path


def made(folder: Path) -> Corpus:
    """Make one of each."""
    outcome = simulate(catalog.find("quick", ["duration_s=4", "warmup_s=2", "drain_s=1", "nodes.count=4"]))
    finish(outcome, out=folder / "run")
    store = Store(folder / "sweep")
    with store.alone():
        store.read()
        tasks = tasks_of(Sweep(base="quick", seeds=2))
        summary = (folder / "run" / "summary.json").read_text()
        for task in tasks:
            store.add(Finished(task.key, "code", 1.0, summary, "{}", None, 1.0))
        store.publish(tasks, ["seed"])
    texts = [catalog.text_of(name) for name in NAMES if name in {entry.name for entry in catalog.shipped()}]
    return Corpus(texts, folder / "run", folder / "sweep")


def changed_text(text: str, random: Random) -> str:
    """A scenario with one line changed, added, doubled or cut."""
    lines = text.splitlines()
    at = random.randrange(len(lines))
    match random.randrange(6):
        case 0:
            lines[at] = re.sub(r"=.*", lambda _: f"= {random.choice(VALUES)}", lines[at])
        case 1:
            lines.insert(at, f"{random.choice(('x', 'seed', 'name', '[radio]', '[[traffic]]', 'a.b.c'))} = 1")
        case 2:
            lines.insert(at, f"[{random.choice(('world', 'nodes', 'x', 'routing.options', 'a[b]'))}]")
        case 3:
            lines.insert(at, lines[at])
        case 4:
            whole = list("\n".join(lines))
            for _ in range(random.randrange(1, 5)):
                whole[random.randrange(len(whole))] = chr(
                    random.choice((0, 9, 34, 61, 91, 0x1F600, random.randrange(1, 0xD000)))
                )
            return "".join(whole)
        case _:
            return "\n".join(lines)[: random.randrange(len(text))]
    return "\n".join(lines)


def scenario(corpus: Corpus, folder: Path, random: Random) -> None:
    path = folder / "some.toml"
    text = changed_text(random.choice(corpus.scenarios), random)
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    require_possible(catalog.find(path))


def options(_: Corpus, folder: Path, random: Random) -> None:
    del folder
    keys = [*catalog.find("quick").model_dump(), "nodes.count", "radio.range_m", "world.area_m", "a", "a.b", "faults.0"]
    given = [f"{random.choice(keys)}={random.choice(VALUES)}" for _ in range(random.randrange(1, 3))]
    require_possible(catalog.find("quick", given))


def change_json(value: Any, random: Random) -> Any:
    """A JSON value with one value in it replaced, removed or doubled."""
    if isinstance(value, dict) and value and random.random() < 0.9:
        key = random.choice(sorted(value))
        if random.random() < 0.15:
            return {name: inner for name, inner in value.items() if name != key}
        return {**value, key: change_json(value[key], random)}
    if isinstance(value, list) and value and random.random() < 0.8:
        at = random.randrange(len(value))
        return [*value[:at], change_json(value[at], random), *value[at + random.randrange(2) :]]
    return random.choice(PLAIN)


def changed_bytes(data: bytes, name: str, random: Random) -> bytes:
    if name.endswith(".json") and random.random() < 0.8:
        return json.dumps(change_json(json.loads(data), random)).encode()
    if name.endswith(".toml") and random.random() < 0.8:
        return changed_text(data.decode(), random).encode("utf-8", "surrogatepass")
    if name.endswith(".jsonl") and random.random() < 0.8:
        lines = data.splitlines(keepends=True)
        at = random.randrange(len(lines))
        lines[at] = json.dumps(change_json(json.loads(lines[at]), random)).encode() + b"\n"
        return b"".join(lines)
    at = random.randrange(len(data) + 1)
    return random.choice((data[:at], data[:at] + bytes([random.randrange(256)]) + data[at + 1 :], b""))


def misplaced(path: Path, random: Random) -> None:
    """Put something else than a file in the place of one."""
    path.unlink()
    match random.randrange(5):
        case 0:
            path.symlink_to(random.choice(("/dev/zero", "/etc/passwd", "nowhere", "../foreign", path.name)))
        case 1:
            os.mkfifo(path)
        case 2:
            path.mkdir()
        case 3:
            path.symlink_to("/dev/full")
        case _:
            pass


def result(corpus: Corpus, folder: Path, random: Random) -> None:
    run = Path(shutil.copytree(corpus.run, folder / "run"))
    name = random.choice(("summary.json", "summary.json", "scenario.toml", "reports.json", "links.json", "trace.jsonl"))
    if random.random() < 0.15:
        misplaced(run / name, random)
    else:
        data = changed_bytes((run / name).read_bytes(), name, random)
        (run / name).write_bytes(data)
        summary = json.loads((corpus.run / "summary.json").read_bytes())
        if name != "summary.json" and random.random() < 0.9:  # consistently forged
            summary["files"][name] = {"bytes": len(data), "sha256": sha256(data).hexdigest()}
            (run / "summary.json").write_text(json.dumps(summary))
    if random.random() < 0.5:
        (run / random.choice(("report.md", "report.html", "replay.html", "replay.html"))).symlink_to("../foreign")
    if random.random() < 0.1:
        (run / "pictures").symlink_to("..")
    match random.randrange(10):
        case 0:
            page.write([run], run)
        case 4:
            contents.of_folder(run)
        case 5:
            outcome = load_result(run).outcome
            random.choice((write_csv, write_parquet))(outcome, run, run / "tables")
            write_gpx(outcome, run / "tracks"), write_mcap(outcome, run / "recording.mcap")
        case 1 | 2 | 3:
            replay_page.write(Replay.read(run, *replay_page.REPLAYED), run / "replay.html")
        case _:
            RunRecords(RunFolder(run).scenario).read(RunFolder(run).records(*SHOWN))
            RunFolder(run).links(), RunFolder(run).agents(), read(run)


def sweep(corpus: Corpus, folder: Path, random: Random) -> None:
    out = Path(shutil.copytree(corpus.sweep, folder / "sweep"))
    paths = [path for path in sorted(out.rglob("*")) if path.is_file()]
    path = random.choice(paths)
    if random.random() < 0.3:
        misplaced(path, random)
    else:
        path.write_bytes(changed_bytes(path.read_bytes(), path.name, random))
    if random.random() < 0.2:
        shutil.rmtree(out / "finished", ignore_errors=True)
        (out / "finished").symlink_to("..")
    if random.random() < 0.5:
        read(out)
    store = Store(out)
    with store.alone():
        store.read()
        tasks = tasks_of(Sweep(base="quick", seeds=2))
        RemainingRuns(tasks, store)
        store.publish(tasks, ["seed"])


KINDS: Final[tuple[Callable[[Corpus, Path, Random], None], ...]] = (scenario, options, result, sweep)


@contextlib.contextmanager
def in_time() -> Iterator[None]:
    """Raises TimeoutError after the longest processor time that an input may take, or ten times that of waiting."""

    def late(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    busy = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S, 1)  # again and again: a callback of the collector swallows one
    signal.setitimer(signal.ITIMER_REAL, 10 * LONGEST_S, 1)  # who waits for ever is not busy
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGPROF, busy)
        signal.signal(signal.SIGALRM, before)


def feed(corpus: Corpus, seed: int, root: Path) -> tuple[bool, list[Wrong]]:
    """Try one input; returns whether it was refused, and what was wrong with the answer."""
    random = Random(seed)
    kind = KINDS[seed % len(KINDS)]
    outside = root / str(seed)
    folder = outside / "inside"
    folder.mkdir(parents=True)
    (outside / "foreign").write_text("untouched")
    wrong: list[Wrong] = []
    why = None
    try:
        with in_time():
            kind(corpus, folder, random)
    except ConfigError as error:
        why = str(error)
    except BaseException as error:  # noqa: BLE001  whatever else it is, it is the finding
        wrong.append(Wrong(seed, kind.__name__, f"{type(error).__name__}: {error}"[:300]))
    if why is not None:
        shown = io.StringIO()
        with contextlib.redirect_stderr(shown):
            assert refused(why) == 2
        lines = shown.getvalue().splitlines()
        if len(lines) > MOST_LINES or any(len(line) > LONGEST_LINE or not line.isprintable() for line in lines):
            wrong.append(Wrong(seed, kind.__name__, f"{len(lines)} lines, {max(map(len, lines))} characters"))
    if [path.name for path in sorted(outside.iterdir())] != ["foreign", "inside"]:
        wrong.append(Wrong(seed, kind.__name__, f"outside: {sorted(path.name for path in outside.iterdir())}"))
    elif (outside / "foreign").read_text() != "untouched":
        wrong.append(Wrong(seed, kind.__name__, "a file outside was written"))
    shutil.rmtree(outside)
    return why is not None, wrong


def main() -> int:
    inputs, first = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    found: list[Wrong] = []
    refusals = 0
    with tempfile.TemporaryDirectory() as place:
        corpus = made(Path(place) / "made")
        for seed in range(first, first + inputs):
            was_refused, wrong = feed(corpus, seed, Path(place))
            refusals += was_refused
            found += wrong
            for one in wrong:
                sys.stdout.write(f"{one}\n")
    sys.stdout.write(f"{inputs} inputs, {refusals} refused, {len(found)} answered wrongly\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

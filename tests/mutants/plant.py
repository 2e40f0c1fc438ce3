"""Plants one-line bugs, one at a time, in a copy of this tree, and says which of them no test notices.

    *.toml here -> a piece of a line becomes another -> the tests that should notice -> caught | survived

What the default tests let pass is tried by the long ones among those that are named, and said to be caught by them.

The list is written by hand: each bug is a mistake that somebody could make, that a user would feel, and that
`random_bugs.py` does not make by itself, as it turns conditions and comparisons and leaves out calls. Kernel and tests
run uncompiled here, because a compilation takes longer than the tests. Exit codes: 0 at most 5 % survived, 1 more did,
or a bug could not be planted or judged.
"""

import argparse
import compileall
import os
import queue
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).parent
LEFT_OUT = (".*", "runs", "build", "dist", "*.egg-info")
PACKAGES = ("fanet_mw", "agents", "emulator", "sim")
MOST_SURVIVORS = 0.05
LIMIT_S = 180.0
"""For the tests of one bug; beyond that it counts as caught: the suite's own limits would end it."""
ALL_LIMIT_S = 1800.0
"""For all of the tests without any bug."""
LONG_LIMIT_S = 900.0
"""For the long tests of one bug; beyond that nothing is said of it."""
NOTICED, PASSED, NONE_CHOSEN = 1, 0, 5
"""What pytest's exit code says; any other means that the tests could not be run."""
DEFAULT, LONG = "not slow", "slow"
"""What pytest chooses by marks."""
BY_LONG = "caught by long tests"
"""The status of a bug that the default tests let pass."""


class Mutant(NamedTuple):
    """One bug."""

    path: str
    rule: str
    """What holds in the sources, and no longer with the bug in them."""
    old: str
    new: str
    after: str
    """The first `old` behind this text is meant; empty: there is only one."""
    tests: tuple[str, ...]
    """Below `tests/`, as pytest names them."""
    sample: bool

    def __str__(self) -> str:
        return f"{self.path}: {self.rule}"

    def place(self, source: str) -> int | str:
        """Where in its file the bug goes; a sentence when that is not clear."""
        if source.count(self.after or self.old) != 1:
            return f"not once, but {source.count(self.after or self.old)} times: {self.after or self.old!r}"
        at = source.find(self.old, source.find(self.after))
        return at if at >= 0 else f"not behind {self.after!r}: {self.old!r}"

    def planted(self, source: str) -> str:
        at = self.place(source)
        assert isinstance(at, int), "who plants has looked"
        return source[:at] + self.new + source[at + len(self.old) :]


class Verdict(NamedTuple):
    """What became of a bug."""

    mutant: Mutant
    status: str
    """`caught`, `caught by long tests`, `survived`, or why it cannot be said."""
    took_s: float


def read() -> list[Mutant]:
    """The whole list, file by file; `equivalent.toml` has none."""
    found = []
    for table in sorted(HERE.glob("*.toml")):
        for group in tomllib.loads(table.read_text(encoding="utf-8")).get("file", ()):
            for entry in group["mutants"]:
                tests = tuple(entry.get("tests", group["tests"]))
                sample = entry.get("sample", False)
                texts = entry["old"], entry["new"], entry.get("after", "")
                found.append(Mutant(group["path"], entry["rule"], *texts, tests, sample))
    return found


def wrong(mutant: Mutant) -> str | None:
    """Why this bug cannot be planted; None: it can."""
    path = ROOT / mutant.path
    if not path.is_file():
        return "there is no such file"
    place = mutant.place(path.read_text(encoding="utf-8"))
    if isinstance(place, str):
        return place
    if mutant.old == mutant.new or "\n" in mutant.old:
        return "it must change one line"
    for test in mutant.tests:
        name, _, function = test.partition("::")
        where = ROOT / "tests" / name
        if not where.exists() or (function and f"def {function}(" not in where.read_text(encoding="utf-8")):
            return f"there is no test {test}"
    return None


def copy_of_the_tree(folder: Path) -> Path:
    """A tree of its own, with what is compiled already: what a bug changes is compiled anew, because its file is
    younger.
    """
    shutil.copytree(ROOT, folder, ignore=shutil.ignore_patterns(*LEFT_OUT), symlinks=True)
    for package in PACKAGES:
        compileall.compile_dir(folder / package, quiet=2)
    return folder


def pytest_in(
    tree: Path, tests: Sequence[str], *further: str, chosen: str = DEFAULT, limit_s: float = LIMIT_S
) -> tuple[int | None, str]:
    """Run some tests in a tree; the exit code, None beyond the limit, and the end of what was said."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", chosen, "-p", "no:cacheprovider"]
    command += ["--hypothesis-profile=mutants", *further, *(f"tests/{test}" for test in tests)]
    environment = {**os.environ, "PYTHONPATH": str(tree), "FANET_NO_NUMBA": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    with tempfile.TemporaryFile("w+") as said:
        child = subprocess.Popen(
            command, cwd=tree, env=environment, stdout=said, stderr=subprocess.STDOUT, start_new_session=True
        )
        try:
            code = child.wait(limit_s)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            if child.poll() is None:
                os.killpg(child.pid, signal.SIGKILL)
                child.wait()
        said.seek(0)
        return code, said.read()[-3000:]


def judge(mutant: Mutant, tree: Path) -> Verdict:
    """Plant one bug in a tree, run the tests that should notice, and take it out again."""
    path, began_s = tree / mutant.path, time.monotonic()
    kept, source = path.stat(), path.read_text(encoding="utf-8")
    path.write_text(mutant.planted(source), encoding="utf-8")
    # Compiled files are told apart by whole seconds and sizes, and the bug may be as long as what it replaces.
    os.utime(path, ns=(kept.st_atime_ns, kept.st_mtime_ns + 10_000_000_000))
    try:
        status = verdict_of(tree, mutant.tests)
    finally:
        path.write_text(source, encoding="utf-8")
        os.utime(path, ns=(kept.st_atime_ns, kept.st_mtime_ns))  # the compiled file is that of this source again
    if status == BY_LONG and pytest_in(tree, mutant.tests, chosen=LONG, limit_s=LONG_LIMIT_S)[0] != PASSED:
        status = "not judged: its long tests do not pass without it either"
    return Verdict(mutant, status, time.monotonic() - began_s)


def verdict_of(tree: Path, tests: Sequence[str]) -> str:
    """The status of the bug that is in a tree: the default tests first, then the long ones."""
    code, said = pytest_in(tree, tests)
    if code in (NOTICED, None):
        return "caught"
    if code not in (PASSED, NONE_CHOSEN):
        return f"not judged:\n{said}"
    long_code, said = pytest_in(tree, tests, chosen=LONG, limit_s=LONG_LIMIT_S)
    if long_code == NOTICED:
        return BY_LONG
    if PASSED in (code, long_code) and long_code in (PASSED, NONE_CHOSEN):
        return "survived"
    return f"not judged:\n{said or 'the long tests took too long'}"


def fails_in(tree: Path, mutants: Sequence[Mutant], *, jobs: int) -> str:
    """What pytest says of all tests that are named, if they fail without a bug; empty: they pass."""
    named = sorted({test for mutant in mutants for test in mutant.tests})
    files = {test for test in named if "::" not in test}
    named = [test for test in named if test in files or test.partition("::")[0] not in files]
    code, said = pytest_in(tree, named, *([f"-n{jobs}"] if jobs > 1 else ()), limit_s=ALL_LIMIT_S)
    return "" if code in (PASSED, NONE_CHOSEN) else said or "took too long"


def plant(mutants: Sequence[Mutant], *, jobs: int, pass_without: bool = True) -> int:
    """Judge all; the exit code. `pass_without`: first see that the tests pass without any bug."""
    with tempfile.TemporaryDirectory(prefix="fanet-mutants-") as folder:
        trees: queue.Queue[Path] = queue.Queue()
        first = copy_of_the_tree(Path(folder) / "0")
        if pass_without and (said := fails_in(first, mutants, jobs=jobs)):
            sys.stderr.write(f"without any bug the tests do not pass:\n{said}\n")
            return 1
        for job in range(1, jobs):
            trees.put(Path(shutil.copytree(first, Path(folder) / str(job), symlinks=True)))
        trees.put(first)

        def in_some_tree(mutant: Mutant) -> Verdict:
            tree = trees.get()
            try:
                return judge(mutant, tree)
            finally:
                trees.put(tree)

        verdicts = []
        with ThreadPoolExecutor(jobs) as pool:
            for verdict in pool.map(in_some_tree, mutants):
                verdicts.append(verdict)
                print(f"{verdict.took_s:6.1f} s  {verdict.mutant}: {verdict.status}", flush=True)
    survivors = [verdict.mutant for verdict in verdicts if verdict.status == "survived"]
    by_long = sum(verdict.status == BY_LONG for verdict in verdicts)
    caught = sum(verdict.status == "caught" for verdict in verdicts) + by_long
    unjudged = len(verdicts) - len(survivors) - caught
    print(f"{len(verdicts)} bugs: {caught} caught ({by_long} by long tests only), {len(survivors)} survived")
    for mutant in survivors:
        print(f"survived  {mutant}\n    - {mutant.old}\n    + {mutant.new}\n    {' '.join(mutant.tests)}")
    return int(unjudged > 0 or len(survivors) > MOST_SURVIVORS * len(verdicts))


def main() -> int:
    flags = argparse.ArgumentParser(prog="scripts/mutants", description="Plant one-line bugs; do the tests notice?")
    flags.add_argument("words", nargs="*", help="only bugs whose file or rule has one of these words")
    flags.add_argument("--check", action="store_true", help="only say whether each bug can still be planted")
    flags.add_argument("--sample", action="store_true", help="only the few that CI runs")
    flags.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="bugs at a time (%(default)s)")
    given = flags.parse_args()
    mutants = [mutant for mutant in read() if mutant.sample or not given.sample]
    mutants = [m for m in mutants if not given.words or any(word in str(m) for word in given.words)]
    broken = [f"{mutant}: {why}" for mutant in mutants if (why := wrong(mutant)) is not None]
    if broken:
        sys.stderr.write("\n".join([*broken, f"{len(broken)} of {len(mutants)} bugs cannot be planted"]) + "\n")
        return 1
    if given.check:
        print(f"{len(mutants)} bugs can be planted")
        return 0
    # Beside the sample CI runs all tests without a bug.
    return plant(mutants, jobs=given.jobs, pass_without=not given.sample)


if __name__ == "__main__":
    sys.exit(main())

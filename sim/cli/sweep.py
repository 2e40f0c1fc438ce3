"""`fanet sweep`: many runs, which are validated before the first one starts and stored as they end."""

import contextlib
import json as json_module
import math
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter
from cyclopts.validators import Number

from fanet_mw.errors import ConfigError
from sim.cli.memory import compile_kernel
from sim.cli.options import require_said_once
from sim.cli.watching import say, watched
from sim.console import Console

if TYPE_CHECKING:
    from pyarrow import Table

    from sim.sweep.spec import Case, Sweep
    from sim.sweep.whole_sweep import Progress, RemainingRuns, Workers

_SAY_S: Final = 20.0
"""The interval at which progress is printed if there is no terminal for a progress bar."""
_KEPT_NOTICE: Final = "they are kept, and the column `code` tells; --rerun-older runs exactly these again"


def sweep(
    what: str,
    *,
    set: Annotated[tuple[str, ...], Parameter(name="--set", negative="", consume_multiple=True)] = (),  # noqa: A002
    seeds: Annotated[int | None, Parameter(validator=Number(gte=1))] = None,
    variant: str | None = None,
    out: Path | None = None,
    jobs: Annotated[int | None, Parameter(validator=Number(gte=1))] = None,
    scheduler: str | None = None,
    retry: Annotated[bool, Parameter(negative="")] = False,
    rerun_older: Annotated[bool, Parameter(negative="")] = False,
    dry_run: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Run a scenario many times in virtual time, with settings and seeds, and make a table of it.

    Exit code 0: every run is in the table; 1: some failed; 2: the sweep or a flag is wrong.

    Args:
        what: A sweep file (TOML with a `base`), a shipped sweep, or a scenario.
        set: Scenario key and its value, or its values in turn: KEY=A,B,C ...; repeatable. Every combination is run.
        seeds: Run every setting with this number of seeds, from 1 on.
        variant: `quick` or `full`, where the sweep has it.
        out: Folder for runs.parquet; by default sweeps/NAME. Runs that are finished there are not repeated.
        jobs: Processes of this machine; by default one per core.
        scheduler: A Dask scheduler, for example tcp://10.0.0.1:8786, whose workers carry out the runs.
        retry: Repeat runs that failed.
        rerun_older: Repeat runs that code other than the present one has finished, so that all rows are of one code.
        dry_run: Validate, count, and stop.
        json: Print what came out, or with --dry-run what would be run, as JSON, on standard output.

    """
    name, wanted = asked(what, set, seeds, variant)
    return carry_out(
        name, wanted, out=out or Path("sweeps") / name, jobs=jobs, scheduler=scheduler, retry=retry,
        rerun_older=rerun_older, dry_run=dry_run, json=json,
    )  # fmt: skip


def carry_out(
    name: str,
    wanted: "Sweep",
    *,
    out: Path,
    jobs: int | None,
    scheduler: str | None,
    retry: bool = False,
    rerun_older: bool = False,
    dry_run: bool = False,
    json: bool = False,
) -> int:
    from sim.cli.foreign_parts import own_output
    from sim.sweep.one_run import processor_s
    from sim.sweep.provenance import code
    from sim.sweep.store import TABLE, Store
    from sim.sweep.tasks import tasks_of
    from sim.sweep.whole_sweep import RemainingRuns, run

    tasks, store = tasks_of(wanted), Store(out)
    with contextlib.ExitStack() as held:
        if out.exists() or not dry_run:
            held.enter_context(store.alone())
            store.read()
        plan = RemainingRuns(tasks, store, retry=retry, only_code=code() if rerun_older else None)
        workers = _workers(jobs, scheduler, plan, dry_run=dry_run)
        say(_announcement(name, wanted, plan, workers))
        _warn_of_codes(plan.codes, "they are run again" if rerun_older else _KEPT_NOTICE)
        if dry_run:
            if json:
                runs = [{"case": task.case, "seed": task.seed, "command": task.command} for task in plan.todo]
                answer = {"table": str(out / TABLE), "finished": plan.total - len(plan.todo), "to_run": runs}
                sys.stdout.write(f"{json_module.dumps(answer)}\n")
            return 0
        if plan.todo:  # once, so that not every worker does so for itself
            compile_kernel(say)
        began, began_cpu_s = time.monotonic(), processor_s()
        with own_output(json=json), _progress(name, plan.total, quiet=json) as tell:
            try:
                table = run(plan, store, workers, wanted.varied(), on_progress=tell)
            except KeyboardInterrupt:
                say(f"interrupted: what is finished is kept in {out}; the same command goes on from there")
                raise
    statuses = table.column("status").to_pylist()
    failed = statuses.count("failed")
    if json:
        answer = {"table": str(out / TABLE), "rows": len(statuses), "failed": failed, "ran": len(plan.todo)}
        sys.stdout.write(f"{json_module.dumps(answer)}\n")
    else:
        took = time.monotonic() - began
        cpu_s = processor_s() - began_cpu_s  # that of workers on this machine, which have ended, is in it
        if scheduler is not None:
            cpu_s += math.fsum(done.cpu_s for task in plan.todo if (done := store.get(task.key)) is not None)
        spent = f"in {took:.0f} s ({cpu_s:.0f} s of CPU)"
        Console().print(f"{_counted(len(statuses), 'row')} in {out / TABLE}, {len(plan.todo)} of them new, {spent}",
                        highlight=False, soft_wrap=True)  # fmt: skip
    if failed:
        _say_failures(table)
    return 1 if failed else 0


def asked(what: str, sets: tuple[str, ...], seeds: int | None, variant: str | None) -> "tuple[str, Sweep]":
    """The sweep that the user means, and its name."""
    from sim.sweep import spec
    from sim.sweep.toml_values import axis

    name = Path(what).stem
    found = spec.find(what).variant(variant)
    require_said_once(sets)
    axes = dict(axis(text) for text in sets)
    fixed = {key: values[0] for key, values in axes.items() if len(values) == 1}
    grid = {key: values for key, values in axes.items() if len(values) > 1}
    kept = {key: values for key, values in found.grid.items() if key not in fixed}
    cases = tuple(_without(case, axes) for case in found.case)
    found = found.model_copy(update={"set": {**found.set, **fixed}, "grid": {**kept, **grid}, "case": cases})
    return name, found if seeds is None else found.model_copy(update={"seeds": seeds})


def _without(case: "Case", flags: Mapping[str, object]) -> "Case":
    """A case without the keys that flags set; raises ConfigError where it sets a table of which one is a part."""
    for key, table in product(flags, case.set):
        if key.startswith(f"{table}."):
            raise ConfigError(f"--set {key}: case {case.name} sets {table}, of which it is a part; set all of {table}")
    kept = {name: {k: v for k, v in getattr(case, name).items() if k not in flags} for name in ("set", "grid")}
    return case.model_copy(update=kept)


def _workers(jobs: int | None, scheduler: str | None, plan: "RemainingRuns", *, dry_run: bool) -> "Workers":
    if scheduler is None or dry_run:
        from sim.sweep.pool import Pool

        cores = len(os.sched_getaffinity(0))
        return Pool(max(1, min(jobs or cores, len(plan.todo))))
    from sim.sweep.dask_cluster import DaskCluster

    return DaskCluster(scheduler)


def _announcement(name: str, wanted: "Sweep", plan: "RemainingRuns", workers: "Workers") -> str:
    settings = plan.total // max(1, len(wanted.seed_list()))
    seeds = _counted(len(wanted.seed_list()), "seed")
    text = f"{name}: {_counted(plan.total, 'run')} ({_counted(settings, 'setting')} x {seeds})"
    if len(plan.todo) < plan.total:
        text += f", {plan.total - len(plan.todo)} finished before"
    if not plan.todo:
        return f"{text}; nothing to do"
    return f"{text}; {workers.workers} process{'' if workers.workers == 1 else 'es'}"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _warn_of_codes(codes: Mapping[str, int], what_follows: str) -> None:
    if others := runs_of_other_code(codes):
        say(f"{others}: {what_follows}", style="bold")


def runs_of_other_code(codes: Mapping[str, int]) -> str:
    """How many of the runs, counted by code, are of code other than the present one; empty if none is."""
    from sim.sweep.provenance import code

    others = {name: codes[name] for name in sorted(codes) if name != code()}
    if not others:
        return ""
    by_code = ", ".join(f"{count} of {name}" for name, count in others.items())
    return (
        f"{sum(others.values())} of {sum(codes.values())} finished runs are of other code ({by_code}; this is {code()})"
    )


def _say_failures(table: "Table") -> None:
    rows = [row for row in table.select(["status", "error", "command"]).to_pylist() if row["status"] == "failed"]
    say(f"{_counted(len(rows), 'run')} failed:", style="bold red")
    for row in rows[:5]:
        say(f"  {row['error'].splitlines()[0]}\n    {row['command']}")


@contextlib.contextmanager
def _progress(name: str, total: int, *, quiet: bool) -> "Iterator[Callable[[Progress], None]]":
    """Says how far a sweep is."""
    with watched(name, total, "runs", every_s=_SAY_S, bar=not quiet, lines=not quiet) as tell:

        def renew(at: "Progress") -> None:
            rest = f"{_left(at)}{_failures(at)}"
            if at.done < at.total:  # the end is said by what came of it
                tell(at.done, rest.removeprefix(", "), f"{name}: {at.done} of {at.total} runs{rest}")

        yield renew


def _left(at: "Progress") -> str:
    return "" if at.left_s is None else f", about {spoken(at.left_s)} left"


def spoken(seconds: float) -> str:
    if seconds < 90:
        return f"{math.ceil(seconds)} s"
    return f"{round(seconds / 60)} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


def _failures(at: "Progress") -> str:
    return f", {at.failed} failed" if at.failed else ""

"""Ctrl-C during a simulation: what there is by then is kept, and said to be partial."""

import io
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rich.console import Console

from fanet_mw.units import MS, S
from sim.records.record_kinds import lines
from sim.results import printed_summary
from sim.results.files import finish
from sim.run.virtual import simulate
from sim.scenarios import catalog

LONG = ("simulate", "quick", "--duration", "100000", "--set", "world.engine=kinematic")


def interrupt(out: Path, *arguments: str, number: int = signal.SIGINT) -> tuple[int, str, str]:
    """Exit code, output and words of a simulation that is interrupted when it has put 200 kB on the air."""
    process = subprocess.Popen(
        [sys.executable, "-m", "sim", *LONG, "--pcap", "--out", str(out), *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    end_s = time.monotonic() + 60
    while (
        not ((out / "air.pcap").exists() and (out / "air.pcap").stat().st_size > 200_000) and time.monotonic() < end_s
    ):
        time.sleep(0.05)
    process.send_signal(number)
    said, err = process.communicate(timeout=60)
    return process.returncode, said, err


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.slow
def test_an_interrupted_simulation_keeps_its_partial_result(tmp_path: Path, number: signal.Signals) -> None:
    as_json = number is signal.SIGTERM
    code, out, err = interrupt(tmp_path, *(("--json",) if as_json else ()), number=number)
    assert code == 1
    summary = json.loads((tmp_path / "summary.json").read_text())
    if as_json:
        assert err == ""
        assert summary == json.loads(out)
    else:
        its_pace_is_that_of_what_was_simulated(out)
    assert summary["aborted"] == f"interrupted by {number.name}"
    assert summary["invalid_because"][0] == f"partial result: interrupted by {number.name}"
    assert 1 < summary["simulated_s"] < summary["duration_s"] == 100_000
    assert summary["frames"]["closes"]
    until_ns, lead_ns = round(summary["simulated_s"] * S), round(catalog.find("quick", []).radio.lead_ms * MS)
    records = [json.loads(line) for line in (tmp_path / "trace.jsonl").read_text().splitlines()]
    announced_ns = max(record[1] for record in records if record[0] == "let_out")
    happened_ns = max(record[1] for record in records if record[0] != "let_out")
    assert until_ns - 2 * S < happened_ns <= until_ns
    assert announced_ns <= until_ns + lead_ns, "a frame is handed over one lead before it is on the air"


def its_pace_is_that_of_what_was_simulated(out: str) -> None:
    words = " ".join(out.split())
    found = re.search(r"partial, ([\d.]+) of 100000 s in ([\d.]+) s \(([\d.]+) x real time\)", words)
    assert found is not None, words
    simulated_s, wall_s, pace = map(float, found.groups())
    rounding = 0.05 + 1e-9
    slowest, fastest = (simulated_s - rounding) / (wall_s + rounding), (simulated_s + rounding) / (wall_s - rounding)
    assert slowest - rounding <= pace <= fastest + rounding, "all three figures are printed to one tenth"
    assert "partial result: interrupted by SIGINT" in words


def test_a_signal_ends_a_run_at_its_next_tenth_of_a_second_and_before_the_first_there_is_nothing() -> None:
    chosen = catalog.find("quick", ["duration_s=10", "world.engine=kinematic"])
    signals: list[int] = []

    def progress(seconds: float) -> None:
        if seconds >= 6.05 and not signals:
            signals.append(signal.SIGTERM)

    part, whole = simulate(chosen, on_progress=progress, signals=signals), simulate(chosen)
    assert part.ended_ns == 6_100_000_000
    assert whole.ended_ns is None
    until = b"".join(lines(part.records))
    assert b"".join(lines(whole.records)).startswith(until), "up to there it is the same run"
    summary = finish(part, out=None)
    assert (summary["simulated_s"], summary["valid"]) == (6.1, False)
    console = Console(file=io.StringIO(), width=200)
    printed_summary.show({**summary, "wall_s": 2.0}, console)
    assert "partial, 6.1 of 10 s in 2.0 s (3.0 x real time)" in console.file.getvalue()  # type: ignore[attr-defined]
    with pytest.raises(KeyboardInterrupt) as caught:
        simulate(chosen, signals=[signal.SIGINT])
    assert caught.value.args == (signal.SIGINT,)

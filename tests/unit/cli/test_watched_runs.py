"""What a run in real time says while it lasts, without a terminal."""

import errno
import io

import pytest
from kit import MakeScenario

from fanet_mw.scenario import Scenario
from sim.cli import runs, watching
from sim.console import Console
from sim.run.collecting.running_tally import Progress


def state(swarm_s: float) -> Progress:
    return Progress(swarm_s, 300.0, 0.75, 0.9876, 0.00456, 7, 0, 16)


def told(monkeypatch: pytest.MonkeyPatch, scenario: Scenario, *, up_s: float, lasts_s: int) -> None:
    """A run that is up after so long and lasts so long, with its progress four times a second."""
    now_s = 100.0
    monkeypatch.setattr(watching, "monotonic", lambda: now_s)
    with runs._watched(scenario, bar=False) as tell:
        for quarter in range(4 * lasts_s):
            now_s = 100 + up_s + quarter / 4
            tell(state(quarter / 4))


def test_a_line_every_ten_seconds_says_how_the_swarm_fares(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], make_scenario: MakeScenario
) -> None:
    told(monkeypatch, make_scenario(), up_s=0, lasts_s=35)
    out, err = capsys.readouterr()
    assert out == "", "that is for the summary"
    assert err.splitlines() == [
        f"{s} of 300 s: clock 0.75, delivered 98.8%, late 0.46%, confirmed 7 of 16" for s in (10, 20, 30)
    ]


def test_a_swarm_that_took_long_to_come_up_is_told_of_once(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], make_scenario: MakeScenario
) -> None:
    told(monkeypatch, make_scenario(), up_s=47, lasts_s=15)
    assert [line.split()[0] for line in capsys.readouterr().err.splitlines()] == ["0", "10"]


def test_what_is_not_known_or_not_searched_for_is_not_said() -> None:
    assert Progress(1.4, 60.0, 1.0, None, 0.0, 0, 0, 0).sentence() == "1 of 60 s: clock 1, late 0.00%"


def test_nobody_who_listens_costs_no_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object, **__: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr(watching.ERR, "print", gone)
    watching.say("47 processes up")


class ClosingTerminal(io.StringIO):
    """A terminal whose window is closed at some time."""

    closes = False

    def isatty(self) -> bool:
        return True

    def write(self, text: str) -> int:
        if self.closes:
            raise OSError(errno.EIO, "Input/output error")
        return super().write(text)


def test_a_terminal_that_is_closed_costs_no_result(
    monkeypatch: pytest.MonkeyPatch, make_scenario: MakeScenario
) -> None:
    """The bar raised as it was taken away, before anything was written: all that was flown was lost with the window."""
    terminal = ClosingTerminal()
    monkeypatch.setattr(watching, "ERR", Console(file=terminal, force_terminal=True))
    with runs._watched(make_scenario(), bar=True) as tell:
        tell(state(1.0))
        terminal.closes = True
    assert "unnamed" in terminal.getvalue()

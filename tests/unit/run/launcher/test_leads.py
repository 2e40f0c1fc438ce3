"""The lead and the handover of processes whose scenario states neither."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.run.launcher.leads import Leads, fitted, fitting, states_leads
from sim.scenarios import catalog


@pytest.mark.parametrize(
    ("processes", "processors", "pause_ms", "lead_ms", "handover_ms"),
    [
        (11, 8, 0.3, 20, 0),  # the least
        (11, 2, 0.3, 30, 0),
        (47, 2, 0.3, 100, 30),  # what `rescue` states
        (47, 2, 90.0, 140, 40),  # longer than the pauses
        (47, 0.5, 3.0, 200, 60),  # the most
    ],
)
def test_the_lead_is_that_of_the_pauses_or_of_the_crowd(
    processes: int, processors: float, pause_ms: float, lead_ms: int, handover_ms: int
) -> None:
    found = fitting(processes=processes, processors=processors, pause_ms=pause_ms)
    assert found == (lead_ms, handover_ms, pause_ms)


@given(st.integers(3, 1000), st.floats(0.1, 128), st.floats(0, 5000), st.floats(0, 5000))
def test_a_longer_pause_never_makes_a_shorter_lead(
    processes: int, processors: float, pause_ms: float, more_ms: float
) -> None:
    first = fitting(processes=processes, processors=processors, pause_ms=pause_ms)
    second = fitting(processes=processes, processors=processors, pause_ms=pause_ms + more_ms)
    assert 20 <= first.lead_ms <= second.lead_ms <= 200
    assert first.lead_ms >= min(200, 1.5 * pause_ms)
    assert 0 <= 2 * first.handover_ms <= first.lead_ms, "an agent's slack is no more than half of the lead"


@pytest.mark.parametrize(
    ("overrides", "states"),
    [([], False), (["radio.lead_ms=0"], False), (["radio.lead_ms=20"], True), (["radio.handover_ms=10"], False)],
)
def test_a_scenario_states_its_lead_or_does_not(overrides: list[str], states: bool) -> None:
    assert states_leads(catalog.find("quick", overrides)) is states


def test_what_a_scenario_states_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.run.launcher.leads._MEASURED_S", 0.05)
    said: list[str] = []
    rescue = catalog.find("rescue")
    assert fitted(rescue, said.append) == (rescue, None)
    assert said == []
    quick, leads = fitted(catalog.find("quick", ["radio.handover_ms=7.5", "seed=9"]), said.append)
    assert isinstance(leads, Leads)
    assert (quick.radio.lead_ms, quick.radio.handover_ms) == (leads.lead_ms, 7.5)
    assert quick.seed == 9
    assert said == [leads.sentence()]
    assert f"lead {leads.lead_ms} ms, handover 7.5 ms" in said[0]
    assert states_leads(quick), "it is chosen once"


def test_a_file_that_says_nothing_of_the_radio_states_no_lead(tmp_path: Path) -> None:
    path = tmp_path / "plain.toml"
    path.write_text("nodes = {count = 5}\nduration_s = 5\n")
    assert not states_leads(catalog.find(path))

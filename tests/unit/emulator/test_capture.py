"""Capture, computed by hand. log_distance: 30 - 40.05 - 30 log10(d) dBm; noise -93.6 dBm; DSSS 11 Mb/s, 984 us.

The receiver, node 2, is at 0. Node 1, at -150 m (-75.3 dBm), and node 3, at +60 m (-63.4 dBm), do not hear each other
(sensitivity -79.5 dBm reaches 207 m; they are 210 m apart).
"""

from collections.abc import Callable

import pytest
from hand_driven import Air, receptions

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US

MakeScenario = Callable[..., Scenario]
FRAME_NS = 984 * US
WEAK, MIDDLE, STRONG = 1, 2, 3
POWERS = {"nodes.count": 3, "radio.channel": "log_distance", "radio.sensitivity_dbm": -79.5}


def heard_by_the_middle(
    scenario: Scenario, *, first: int, then: int, after_ns: int
) -> tuple[list[tuple[int, int]], dict[str, int]]:
    """(transmitter, end) of what node 2 received, and what became of lost copies."""
    air = Air(scenario, [-150, 0, 60])
    air.send(first, 1 * MS)
    air.send(then, 1 * MS + after_ns)
    heard = [(src, end_ns) for node, src, end_ns in receptions(air.run()) if node == MIDDLE]
    return heard, air.medium.report()["copies"]["lost"]


def test_a_stronger_later_frame_is_taken_and_the_first_is_lost(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**POWERS, **{"radio.capture": True})
    heard, lost = heard_by_the_middle(scenario, first=WEAK, then=STRONG, after_ns=400 * US)
    assert heard == [(STRONG, 1 * MS + 400 * US + FRAME_NS + 200)]
    assert lost == {"collision": 1}


def test_without_capture_the_same_timeline_loses_both(make_scenario: MakeScenario) -> None:
    heard, lost = heard_by_the_middle(make_scenario(**POWERS), first=WEAK, then=STRONG, after_ns=400 * US)
    assert heard == []
    assert lost == {"collision": 2}


def test_a_weaker_later_frame_takes_nothing(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**POWERS, **{"radio.capture": True})
    heard, lost = heard_by_the_middle(scenario, first=STRONG, then=WEAK, after_ns=400 * US)
    assert heard == [(STRONG, 1 * MS + FRAME_NS + 200)], "12 dB above the interference: it survives"
    assert lost == {"collision": 1}


@pytest.mark.parametrize(("threshold_db", "captured"), [(11.9, True), (12.0, False)])
def test_the_threshold_is_the_ratio_of_the_two_frames(
    make_scenario: MakeScenario, threshold_db: float, captured: bool
) -> None:
    """30 log10(150 / 60) = 11.94 dB."""
    scenario = make_scenario(**POWERS, **{"radio.capture": True, "radio.capture_db": threshold_db})
    heard, _ = heard_by_the_middle(scenario, first=WEAK, then=STRONG, after_ns=400 * US)
    assert [src for src, _ in heard] == ([STRONG] if captured else [])


def test_a_frame_that_begins_before_the_first_is_detected_is_not_a_capture(make_scenario: MakeScenario) -> None:
    """2 us apart: the weak one is drowned before it is found, the strong one is simply found; either way."""
    for capture in (False, True):
        scenario = make_scenario(**POWERS, **{"radio.capture": capture})
        heard, _ = heard_by_the_middle(scenario, first=WEAK, then=STRONG, after_ns=2 * US)
        assert [src for src, _ in heard] == [STRONG]


def test_after_a_capture_the_medium_is_idle_when_both_frames_have_ended(make_scenario: MakeScenario) -> None:
    air = Air(make_scenario(**POWERS, **{"radio.capture": True}), [-150, 0, 60])
    air.send(WEAK, 1 * MS)
    air.send(STRONG, 1 * MS + 400 * US)
    air.send(MIDDLE, 1 * MS + 500 * US)
    ends = {(node, src): end_ns for node, src, end_ns in receptions(air.run())}
    backoff_ns = ends[STRONG, MIDDLE] - FRAME_NS - 200 - (1 * MS + 400 * US + FRAME_NS + 200) - 50 * US
    assert backoff_ns % (20 * US) == 0
    assert 0 <= backoff_ns <= 31 * 20 * US


def test_capture_without_powers_is_refused(make_scenario: MakeScenario) -> None:
    with pytest.raises(ConfigError, match="needs a channel with powers"):
        make_scenario(**{"radio.capture": True})

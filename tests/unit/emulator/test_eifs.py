"""After a reception that failed, by timelines computed by hand: IEEE 802.11-2020, 10.3.2.3.7, and as ns-3.44 has it.

The timelines are those that `tests/ns3/eifs_timelines.py` puts before a live ns-3.
"""

import numpy as np
import pytest
from hand_driven import Air, statuses
from kit import MakeScenario

from emulator.kernel import state as k
from emulator.kernel.channel_access import on_busy
from fanet_mw.units import US
from tests.ns3.eifs_timelines import DIFS_US, LISTENER, PLACES_M, TIMELINES, Timeline, asked_of

Access = str | list[str]
FRAME_US, SLOT_US = 984, 20
SEEDS = range(1, 5)


def began_us(make_scenario: MakeScenario, timeline: Timeline, *, access: Access, seed: int = 1) -> float:
    """When the listener's frame begins; backoffs are of 0 or 1 slot."""
    keys = {"nodes.count": len(PLACES_M), "radio.access": access, "radio.cw_min": 1, "seed": seed}
    air = Air(make_scenario(**keys), [float(place_m) for place_m in PLACES_M])
    for node, at_us, size in asked_of(timeline, difs_first=access != "standard"):
        air.send(node, at_us * US, payload=bytes(size))
    (ended_ns,) = [end_ns for node, _, end_ns, _ in statuses(air.run()) if node == LISTENER]
    return ended_ns / US - FRAME_US


@pytest.mark.parametrize("timeline", TIMELINES, ids=[timeline.name for timeline in TIMELINES])
def test_by_the_standard_eifs_begins_when_the_medium_is_idle_after_the_bad_frame(
    make_scenario: MakeScenario, timeline: Timeline
) -> None:
    began = {began_us(make_scenario, timeline, access="standard", seed=seed) for seed in SEEDS}
    assert sorted(began) == pytest.approx([timeline.standard_us, timeline.standard_us + SLOT_US], abs=0.001)


@pytest.mark.parametrize("timeline", TIMELINES[:-1], ids=[timeline.name for timeline in TIMELINES[:-1]])
def test_a_frame_that_waited_through_the_bad_one_is_held_back_as_long(
    make_scenario: MakeScenario, timeline: Timeline
) -> None:
    early = timeline._replace(asked_us=1200)
    began = {began_us(make_scenario, early, access="standard", seed=seed) for seed in SEEDS}
    assert sorted(began) == pytest.approx([timeline.standard_us, timeline.standard_us + SLOT_US], abs=0.001)


@pytest.mark.parametrize("timeline", TIMELINES, ids=[timeline.name for timeline in TIMELINES])
@pytest.mark.parametrize("access", ["ns3", ["difs", "eifs"]])
def test_as_ns3_has_it_eifs_runs_from_the_end_of_the_bad_frame(
    make_scenario: MakeScenario, timeline: Timeline, access: Access
) -> None:
    assert began_us(make_scenario, timeline, access=access) == pytest.approx(timeline.ns3_us, abs=0.001)


@pytest.mark.parametrize("timeline", TIMELINES, ids=[timeline.name for timeline in TIMELINES])
def test_the_standards_eifs_goes_with_every_other_habit_of_ns3(make_scenario: MakeScenario, timeline: Timeline) -> None:
    """In ns-3 who finds the medium idle waits for DIFS from then on, and draws no backoff."""
    began = began_us(make_scenario, timeline, access=["difs", "sums", "onset"])
    assert began == pytest.approx(max(timeline.standard_us, timeline.asked_us + DIFS_US), abs=0.001)


@pytest.mark.parametrize(("busy_us", "passed"), [(149, False), (150, True), (151, True)])
def test_eifs_has_passed_when_difs_has_followed_it_without_a_break(busy_us: int, passed: bool) -> None:
    """A medium that becomes busy in the last instant of DIFS interrupts nothing any more."""
    p, st = np.zeros(k.PARAMETERS, dtype=np.int64), np.zeros((k.STATION_ROWS, 1), dtype=np.int64)
    p[k.DIFS_NS], p[k.SLOT_NS] = DIFS_US * US, SLOT_US * US
    st[[k.BUSY_SINCE, k.SCHEDULED], 0] = -1
    st[k.BAD_UNTIL, 0] = (150 - DIFS_US) * US
    on_busy(p, st, 0, busy_us * US)
    assert (st[k.BAD_UNTIL, 0] == 0) == passed
    assert st[k.BUSY_SINCE, 0] == busy_us * US

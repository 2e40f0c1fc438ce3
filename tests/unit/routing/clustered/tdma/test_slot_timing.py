"""Superframe geometry: which instant belongs to which slot."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.errors import LocalProtocolError
from fanet_mw.routing.clustered.tdma.slot_timing import Superframe
from fanet_mw.units import MS

FRAME = Superframe(origin_ns=0, period_ns=100 * MS, slot_ns=25 * MS, guard_ns=2 * MS)


def slot_at(frame: Superframe, t_ns: int) -> int | None:
    """The slot in whose usable part an instant lies; None in a guard time, or in the rest of the superframe."""
    slot, rest = divmod((t_ns - frame.origin_ns) % frame.period_ns, frame.slot_ns)
    return slot if slot < frame.slots and rest < frame.slot_ns - frame.guard_ns else None


def test_a_slot_asked_for_inside_itself_is_the_current_one() -> None:
    assert FRAME.occurrence(1, not_before_ns=30 * MS) == (25 * MS, 48 * MS)


def test_a_slot_asked_for_in_its_guard_time_is_the_next_one() -> None:
    assert FRAME.occurrence(1, not_before_ns=48 * MS) == (125 * MS, 148 * MS)


def test_a_slot_asked_for_before_it_is_still_to_come() -> None:
    assert FRAME.occurrence(3, not_before_ns=0) == (75 * MS, 98 * MS)


def test_the_guard_time_belongs_to_nobody() -> None:
    assert slot_at(FRAME, 24 * MS) is None
    assert slot_at(FRAME, 25 * MS) == 1


@pytest.mark.parametrize("guard_ns", [-1, 25 * MS])
def test_a_guard_that_leaves_no_slot_is_refused(guard_ns: int) -> None:
    with pytest.raises(LocalProtocolError, match="guard_ns"):
        FRAME._replace(guard_ns=guard_ns).check()


@given(
    origin_ns=st.integers(-(10**12), 10**12),
    slot_ns=st.integers(1, 10**9),
    slots=st.integers(1, 60),
    rest_ns=st.integers(0, 10**6),
    data=st.data(),
)
def test_an_occurrence_belongs_to_its_slot_and_is_the_first_that_does(
    origin_ns: int, slot_ns: int, slots: int, rest_ns: int, data: st.DataObject
) -> None:
    guard_ns = data.draw(st.integers(0, slot_ns - 1))
    frame = Superframe(origin_ns, slots * slot_ns + rest_ns % slot_ns, slot_ns, guard_ns)
    slot = data.draw(st.integers(0, slots - 1))
    asked_ns = data.draw(st.integers(-(10**13), 10**13))
    found = frame.occurrence(slot, not_before_ns=asked_ns)
    assert slot_at(frame, found.start_ns) == slot
    assert slot_at(frame, found.end_ns - 1) == slot
    assert found.end_ns > asked_ns
    assert found.end_ns - frame.period_ns <= asked_ns, "an earlier occurrence was still open"

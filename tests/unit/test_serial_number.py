"""Sequence numbers that wrap, of any width (RFC 1982)."""

from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.serial_number import following, later, newer

widths = st.sampled_from([8, 16, 32])


@given(widths, st.data())
def test_the_next_numbers_are_newer_across_the_wrap_and_never_the_other_way_around(
    bits: int, data: st.DataObject
) -> None:
    number = data.draw(st.integers(0, (1 << bits) - 1))
    step = data.draw(st.integers(1, (1 << (bits - 1)) - 1))
    ahead = following(number, step=step, bits=bits)
    assert 0 <= ahead < 1 << bits
    assert newer(ahead, number, bits=bits)
    assert not newer(number, ahead, bits=bits)
    assert later(number, ahead, bits=bits) == later(ahead, number, bits=bits) == ahead
    assert not newer(number, number, bits=bits)


def test_after_the_last_number_comes_zero() -> None:
    assert following(0xFFFF, bits=16) == 0
    assert newer(0, 0xFFFF, bits=16)

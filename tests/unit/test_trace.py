"""Trace records: one record is one line of JSON, and parsing the line gives the record."""

import json

from hypothesis import given
from hypothesis import strategies as st

from fanet_mw import trace
from fanet_mw.trace import Delivered

whole = st.integers(0, 2**40)


@given(st.tuples(whole, whole, whole, whole, whole, whole, whole))
def test_a_delivery_is_written_in_the_order_of_its_fields_and_read_again(fields: tuple[int, ...]) -> None:
    record = Delivered(*fields)
    text = trace.line(record)
    assert json.loads(text) == ["delivered", *fields]
    assert trace.parse(text) == record

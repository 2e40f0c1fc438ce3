"""The Hungarian method finds an assignment of least cost."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from agents.mission.hungarian import assign


@given(
    st.integers(1, 5).flatmap(
        lambda n: st.lists(st.lists(st.integers(0, 50), min_size=6, max_size=6), min_size=n, max_size=n)
    )
)
def test_no_other_assignment_costs_less(costs: list[list[int]]) -> None:
    chosen = assign(costs)
    assert len(set(chosen)) == len(costs)
    least = min(
        sum(row[column] for row, column in zip(costs, columns, strict=True))
        for columns in itertools.permutations(range(6), len(costs))
    )
    assert sum(row[column] for row, column in zip(costs, chosen, strict=True)) == least

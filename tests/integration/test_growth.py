"""What an actor keeps is bounded: in a long run nothing grows for good but stores that are known to be full one day."""

from collections.abc import Sequence

import pytest

from tests.benchmarks.growth import entries, grown

FULL_ONE_DAY = {
    "DuplicateSet.young",  # two generations of 32,768 packets: `DuplicateSet`
    "DuplicateSet.old",
    "PhoneSensor._shadow",  # emptied when it is full: `KEPT_VALUES`
    "PaperRule._readings[]",  # one of each survivor by each node
}
COME_AND_GO = 20


class Leaks:
    """Stands in for an actor whose list nobody empties."""

    def __init__(self, kept: Sequence[int]) -> None:
        self.kept = list(kept)


def test_entries_of_containers_are_counted_where_they_stand() -> None:
    Leaks.__module__ = "agents.leaks"
    counted = entries([Leaks(range(3)), Leaks(range(40))])  # type: ignore[list-item]
    assert counted == {"Leaks.kept": 43}


@pytest.mark.slow
@pytest.mark.parametrize(
    "overrides",
    [[], ["clusters.relay=scheduled"], ["routing.protocol=aodv"], ["clusters.repair_s=5"]],
    ids=["clusters", "timetable", "aodv", "repair"],
)
def test_in_a_run_of_five_minutes_nothing_else_grows(overrides: Sequence[str]) -> None:
    """In each quarter of the run: what has grown in one of them alone has come to its size, or will go again."""
    quarters = [now - before for _, now, before in grown("quick", 300, overrides)]
    growing = [{place for place, more in grew.items() if more >= COME_AND_GO} for grew in quarters]
    assert set.intersection(*growing) <= FULL_ONE_DAY

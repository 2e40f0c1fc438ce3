"""The table of the paper's rescue: times count from the seeds in which half of the swarm turned."""

from typing import Any

import pytest

from tests.tables.missions import half_approached_s
from tests.tables.paper_rescue import paper_row


def _run(times_s: list[float], **others: Any) -> dict[str, Any]:
    found = {
        "enough_heard_s": 20.0,
        "reports": 0.9,
        "pdr": 0.99,
        "connected": 1.0,
        "collisions": 0,
        "code": "0.1.0+abc",
    }
    turned = {"uavs_approaching": len(times_s), "half_approached_s": half_approached_s(45, times_s)}
    return {**turned, **found, **others}


def test_a_seed_in_which_nobody_hears_a_phone_counts_as_nobody_turning_and_for_no_time() -> None:
    all_turn = _run([20.5 + 0.5 * place for place in range(45)], collisions=1)
    nobody = _run([], enough_heard_s=None, reports=None)
    seeds, anybody, turned, half_s, wait_s, app_2, _, connected, contacts, code = paper_row("1.0", [all_turn, nobody])[
        1:
    ]
    assert (seeds, anybody, turned) == ("2", "1", "22 [0, 45]")
    assert half_s == "31 [31, 31]", "the 22nd UAV turns after 31 s"
    assert wait_s == "11.00 [11.00, 11.00]"
    assert app_2 == "0.90 [0.90, 0.90]"
    assert (connected, contacts, code) == ("100 [100, 100]", "1", "abc")


@pytest.mark.parametrize(("turned", "times"), [(21, "-"), (22, "21 [21, 21]")])
def test_only_half_of_the_swarm_has_a_time(turned: int, times: str) -> None:
    assert paper_row("0.1", [_run([21.0] * turned)])[4] == times

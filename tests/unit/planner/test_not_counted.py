"""What a plan does not count: faults, movement, obstacles and losses; and what its sentences then still say."""

from typing import Any

import pytest

from fanet_mw.scenario import Scenario, config
from sim.planner.answer import judge
from sim.scenarios import catalog

NINE = ("nodes.count=9", "clusters.count=8", "traffic.sources=8")
CUT = {"kind": "cut", "at_s": 30, "node": 3}
EVERYONE = "every packet reaches everyone"


def with_faults(*faults: dict[str, Any], settings: tuple[str, ...] = ()) -> Scenario:
    tree = catalog.find("clusters", [*NINE, *settings]).model_dump(exclude_none=True)
    return config.build({**tree, "faults": faults})


def planned(scenario: Scenario) -> tuple[str, list[str]]:
    text, plan, _ = judge(scenario, change=False)
    return " ".join(text.split()), plan["not_counted"]


def test_a_swarm_at_rest_whose_frames_arrive_has_nothing_that_is_not_counted() -> None:
    text, left = planned(with_faults())
    assert left == []
    assert "not counted " not in text
    assert EVERYONE in text


def test_faults_are_named_with_the_instant_of_the_first() -> None:
    early = {"kind": "degrade", "at_s": 20, "loss_share": 0.5}
    text, left = planned(with_faults(CUT, early))
    assert len(left) == 1
    assert "holds until 20 s; then packets may miss nodes" in left[0]
    assert "bounds that nodes state for their packets in flight hold" in left[0]
    assert f"not counted {left[0]}" in text
    assert EVERYONE not in text


def test_without_a_timetable_there_is_no_bound_to_speak_of() -> None:
    _, (said,) = planned(with_faults(CUT, settings=("clusters.relay=all", "traffic.interval_s=5")))
    assert said.endswith("then packets may miss nodes")


def test_faults_after_the_end_and_the_ends_of_faults_are_none() -> None:
    restore = {"kind": "restore", "at_s": 5}
    assert planned(with_faults({**CUT, "at_s": 60}, restore, settings=("duration_s=60",)))[1] == []
    assert planned(with_faults({**CUT, "at_s": 59.9}, restore, settings=("duration_s=60",)))[1] != []


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        (("mobility.model=random_waypoint",), 'movement (mobility.model = "random_waypoint")'),
        (("world.buildings=5",), "obstacles: a link that they block"),
        (
            ("radio.channel=log_distance", "radio.fading=rician", "radio.shadowing_db=3", "clusters.links=places"),
            'losses by radio.fading = "rician" and radio.shadowing_db = 3: packets may miss nodes; bounds are for',
        ),
    ],
)
def test_what_moves_blocks_or_loses_is_named_with_its_keys(settings: tuple[str, ...], named: str) -> None:
    text, left = planned(with_faults(settings=settings))
    assert len(left) == 1
    assert left[0].startswith(named)
    assert EVERYONE not in text


def test_measured_links_count_losses_but_no_faults() -> None:
    lossy = ("radio.channel=log_distance", "radio.fading=rician")
    text, left = planned(with_faults(CUT, settings=lossy))
    assert len(left) == 1
    assert left[0].startswith("[[faults]]")
    assert f"not counted {left[0]}" in text


def test_a_plan_that_is_not_feasible_does_not_say_that_all_packets_arrive() -> None:
    text, _ = planned(with_faults(settings=('nodes.layout="line"', "routing.hop_limit=3")))
    assert "NOT FEASIBLE" in text
    assert "none in this channel" in text
    assert EVERYONE not in text


@pytest.mark.parametrize(("relay", "lines"), [("all", 1), ("scheduled", 0)])
def test_a_channel_with_noise_loses_frames_of_which_only_a_timetable_knows_the_probability(
    relay: str, lines: int
) -> None:
    keys = (f"clusters.relay={relay}", "radio.channel=log_distance", "clusters.links=places")
    _, left = planned(with_faults(settings=keys))
    assert len(left) == lines
    assert all('losses by radio.channel = "log_distance"' in said for said in left)

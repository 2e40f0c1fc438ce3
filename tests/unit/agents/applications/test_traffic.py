"""When an application has its next packet, who sends and for whom."""

from collections.abc import Callable
from itertools import pairwise

import pytest

from agents.applications.traffic import TrafficGenerator, sources_of, targets_of
from fanet_mw.scenario import Scenario
from fanet_mw.units import MS, US, NodeId, S

MakeScenario = Callable[..., Scenario]


def births(scenario: Scenario, node: int) -> list[int]:
    traffic = TrafficGenerator(scenario, NodeId(node))
    found = []
    while (born_ns := traffic.next_ns()) is not None:
        found.append(born_ns)
        traffic.advance()
    return found


def make(make_scenario: MakeScenario, **traffic: object) -> Scenario:
    keys = {"nodes.count": 9, "duration_s": 40, "warmup_s": 5, "drain_s": 2}
    return make_scenario(**keys, **{f"traffic.{key}": value for key, value in ({"sources": "all"} | traffic).items()})


def test_cbr_comes_at_its_interval_in_the_measured_window_each_source_in_a_phase_of_its_own(
    make_scenario: MakeScenario,
) -> None:
    scenario = make(make_scenario, interval_s=0.5)
    phases = set()
    for node in range(1, 10):
        found = births(scenario, node)
        assert {b - a for a, b in pairwise(found)} == {500 * MS}
        assert 5 * S <= found[0] < 5 * S + 500 * MS
        assert 38 * S - 500 * MS <= found[-1] < 38 * S
        phases.add(found[0])
    assert len(phases) == 9
    assert max(phases) - min(phases) > 200 * MS


def test_poisson_arrivals_have_their_mean_and_are_born_at_whole_microseconds(make_scenario: MakeScenario) -> None:
    scenario = make(make_scenario, interval_s=0.1, arrivals="poisson")
    found = [born_ns for node in range(1, 10) for born_ns in births(scenario, node)]
    assert len(found) == pytest.approx(9 * 33 / 0.1, rel=0.1)
    assert all(born_ns % US == 0 for born_ns in found)
    assert 5 * S <= min(found) <= max(found) < 38 * S


def test_what_should_have_been_born_before_a_start_never_was(make_scenario: MakeScenario) -> None:
    scenario = make(make_scenario, interval_s=0.5)
    on_time = births(scenario, 3)
    traffic = TrafficGenerator(scenario, NodeId(3))
    traffic.start(20 * S)
    assert traffic.next_ns() == min(born_ns for born_ns in on_time if born_ns >= 20 * S)


def test_a_packet_is_meant_for_all_but_its_source(make_scenario: MakeScenario) -> None:
    assert targets_of(make(make_scenario), 4) == [1, 2, 3, 5, 6, 7, 8, 9]
    assert targets_of(make(make_scenario, targets=[2, 4]), 4) == [2]


@pytest.mark.parametrize("count", [1, 5, 8])
def test_few_sources_are_members_and_not_the_leader(make_scenario: MakeScenario, count: int) -> None:
    for seed in range(1, 6):
        scenario = make(make_scenario, sources=count)
        chosen = sources_of(scenario.model_copy(update={"seed": seed}))
        assert len(chosen) == count
        assert scenario.leader not in chosen


def test_as_many_sources_as_there_can_be_are_all_but_the_destination(make_scenario: MakeScenario) -> None:
    scenario = make(make_scenario, sources=8, destination=4)
    assert list(sources_of(scenario)) == [1, 2, 3, 5, 6, 7, 8, 9]


# --- several classes --------------------------------------------------------------------------------------------------

CLASSES = [
    {"name": "app_1", "payload_bytes": 1024, "interval_s": 1.0},
    {"name": "app_2", "payload_bytes": 512, "interval_s": 0.5, "priority": "report", "sources": [2, 3], "start_s": 10},
]


def of_class(scenario: Scenario, node: int, name: str) -> list[tuple[int, int]]:
    """(birth, bytes) of the packets of one class at one node."""
    traffic = TrafficGenerator(scenario, NodeId(node), name)
    found = []
    while (born_ns := traffic.next_ns()) is not None:
        found.append((born_ns, traffic.next_bytes))
        traffic.advance()
    return found


def test_each_class_has_its_own_sources_start_size_and_interval(make_scenario: MakeScenario) -> None:
    scenario = make_scenario(**{"nodes.count": 9, "duration_s": 40, "warmup_s": 5, "drain_s": 2, "traffic": CLASSES})
    assert [*scenario.traffic_classes] == ["app_1", "app_2"]
    assert list(sources_of(scenario, "app_2")) == [2, 3]
    first, second = of_class(scenario, 2, "app_1"), of_class(scenario, 2, "app_2")
    assert (len(first), {size for _, size in first}) == (33, {1024})
    assert (len(second), {size for _, size in second}) == (56, {512})
    assert 10 * S <= second[0][0] < 10.5 * S
    assert of_class(scenario, 4, "app_2") == []


def test_a_single_table_and_the_first_of_several_have_the_same_packets(make_scenario: MakeScenario) -> None:
    alone = make(make_scenario, interval_s=0.5)
    keys = {"nodes.count": 9, "duration_s": 40, "warmup_s": 5, "drain_s": 2}
    both = make_scenario(**keys, traffic=[{"interval_s": 0.5}, CLASSES[1]])
    assert births(alone, 3) == births(both, 3)
    assert [*both.traffic_classes] == ["traffic", "app_2"]


def test_an_on_off_source_sends_in_its_periods_and_pauses_between(make_scenario: MakeScenario) -> None:
    found = []
    for node in range(1, 10):
        scenario = make_scenario(
            **{"nodes.count": 9, "duration_s": 400, "traffic.arrivals": "on_off", "traffic.interval_s": 0.1,
               "traffic.on_s": 2, "traffic.off_s": 6}
        )  # fmt: skip
        found.append(births(scenario, node))
    gaps = [b - a for line in found for a, b in pairwise(line)]
    assert min(gaps) == 100 * MS
    pauses = [gap for gap in gaps if gap > 150 * MS]
    assert sum(pauses) / len(pauses) == pytest.approx(6 * S, rel=0.25)
    assert len(gaps) == pytest.approx(9 * 400 * 0.25 / 0.1, rel=0.25)


def test_a_trace_gives_each_packets_instant_and_size(make_scenario: MakeScenario) -> None:
    keys = {"nodes.count": 3, "warmup_s": 2, "traffic.arrivals": "trace", "traffic.packets": [(1.5, 200), (0.25, 64)]}
    assert of_class(make_scenario(**keys), 2, "traffic") == [(2250 * MS, 64), (3500 * MS, 200)]
    late = TrafficGenerator(make_scenario(**keys), NodeId(2))
    late.start(3 * S)
    assert (late.next_ns(), late.next_bytes) == (3500 * MS, 200)

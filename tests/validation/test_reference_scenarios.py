"""A sample of the reference cases, run as a user would run them; `scripts/validate` runs and prints all."""

from collections.abc import Sequence

import pytest
from kit import slow
from reference import Case, Compared, Metric, cases, measure, verdict

_SAMPLE = {
    "broadcast A n=10 every 0.01 s": 1, "broadcast B n=10 every 0.01 s": 1,
    "hidden terminals unicast poisson every 0.02 s": 2, "flooding 9 x 5, 20 sources every 1 s": 2,
}  # fmt: skip
"""Cases, and how many seeds of each are enough to disagree with."""
_ALL = cases()
_FEW = [case._replace(seeds=_SAMPLE[case.name]) for case in _ALL if case.name in _SAMPLE]


def can_disagree(case: Case) -> list[str]:
    exact = [Compared(case.name, metric, case.seeds, metric.ns3, metric.ns3) for metric in case.metrics]
    return [compared.metric.key for compared in exact if compared.can_disagree]


def test_in_the_sample_the_same_figures_can_disagree_as_with_all_seeds() -> None:
    assert {case.name for case in _FEW} == set(_SAMPLE)
    for few in _FEW:
        (many,) = (case for case in _ALL if case.name == few.name)
        assert can_disagree(few) == can_disagree(many) != [], few.name


@pytest.mark.parametrize("case", [*_FEW[:-1], *slow((_FEW[-1],))], ids=lambda case: case.name)
def test_a_shipped_scenario_agrees_with_ns3_in_a_few_runs(case: Case) -> None:
    for compared in measure(case):
        assert compared.agrees, compared.line()
        assert compared.standard_agrees, compared.line()


@pytest.mark.slow
@pytest.mark.parametrize("case", _ALL, ids=lambda case: case.name)
def test_a_shipped_scenario_agrees_with_ns3_by_either_way_of_access(case: Case) -> None:
    for compared in measure(case):
        assert compared.agrees, compared.line()
        assert compared.standard_agrees, compared.line()


# --- what the count of agreeing figures is worth ------------------------------------------------------------------


def figure(ns3: float, sd: float = 0.0, *, key: str = "pdr", ours: float = 0.5, relative: float = 0.0) -> Compared:
    return Compared("case", Metric(key, ns3, sd, runs=4, relative=relative), 4, ours, standard=ours)


@pytest.mark.parametrize(
    ("compared", "can_disagree"),
    [
        (figure(0.9), True),
        (figure(1.0), False),
        (figure(0.0), False),
        (figure(0.99), True),
        (figure(0.75, 0.44), False),
        (figure(0.5, 0.2), True),
        (figure(0.4, relative=0.05, key="air.mean_retries"), True),
        (figure(0.4, 0.6, relative=0.05, key="air.mean_retries"), False),
        (figure(5.6, relative=0.03, key="air.throughput_mbps"), True),
    ],
)
def test_a_figure_that_agrees_with_nothing_or_with_everything_cannot_disagree(
    compared: Compared, can_disagree: bool
) -> None:
    assert compared.can_disagree is can_disagree


def test_the_tolerance_is_three_standard_errors_of_the_difference_if_that_is_more_than_two_in_a_hundred() -> None:
    assert figure(0.5, 0.02).tolerance == pytest.approx(3 * 0.02 * (1 / 4 + 1 / 4) ** 0.5)
    assert figure(0.5, 0.001).tolerance == 0.02
    assert figure(0.98).tolerance == pytest.approx(0.01), "half of what is lost"
    assert figure(5.0, relative=0.03).tolerance == pytest.approx(0.15)


def test_only_figures_that_can_disagree_are_counted_as_agreeing() -> None:
    done: Sequence[Compared] = [figure(0.5), figure(0.6), figure(1.0, ours=1.0), figure(0.0, ours=0.5)]
    first, second = verdict(done).splitlines()
    assert first.startswith("1 of 2 figures that can disagree agree with ns-3")
    assert second.startswith("Of 2 more, whose tolerance reaches 0 or 1, 1 agree")


def test_two_thirds_of_the_figures_of_the_tables_can_disagree_and_those_of_hidden_terminals_closely() -> None:
    exact = [Compared(c.name, m, c.seeds, m.ns3, m.ns3) for c in _ALL for m in c.metrics]
    telling = [compared for compared in exact if compared.can_disagree]
    assert len(telling) >= 2 * len(exact) / 3
    hidden = [compared for compared in telling if compared.case.startswith("hidden")]
    assert len(hidden) >= 12
    assert all(compared.tolerance < 0.15 for compared in hidden)

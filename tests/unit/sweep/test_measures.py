"""What a run of a sweep measures besides its summary, on traces written by hand."""

from collections.abc import Sequence

import pytest

from fanet_mw.trace import Approaching, Delivered, Detected, Generated, Record
from fanet_mw.units import MS, S
from sim.results.outcome import Outcome
from sim.scenarios import catalog
from sim.sweep.measures import DELAY_EDGES_S, MEASURES

SETTINGS = ["nodes.count=4", "traffic.sources=all"]


def measured(name: str, records: Sequence[Record], *settings: str) -> object:
    return MEASURES[name](Outcome(catalog.find("flooding", [*SETTINGS, *settings]), "virtual", 0.0, records, {}))


def sent(node: int, seq: int, *, t_ns: int = 0) -> Generated:
    return Generated(t_ns, node, seq, "traffic", 100)


def arrived(origin: int, seq: int, *, at: int, delay_ns: int, born_ns: int = 0) -> Delivered:
    return Delivered(born_ns + delay_ns, at, origin, seq, delay_ns, 1)


PACKETS = [
    sent(1, 1), sent(2, 1), sent(2, 2), sent(3, 1),
    arrived(2, 1, at=1, delay_ns=20 * MS), arrived(2, 1, at=3, delay_ns=30 * MS), arrived(3, 1, at=1, delay_ns=40 * MS),
    arrived(1, 1, at=2, delay_ns=2 * S),
]  # fmt: skip


def test_the_leader_counts_what_others_sent_and_it_received() -> None:
    assert measured("leader_pdr", PACKETS) == pytest.approx(2 / 3)
    assert measured("leader_delay_s", PACKETS) == pytest.approx(0.03)
    assert measured("leader_pdr", PACKETS[:1]) is None
    assert measured("leader_delay_s", PACKETS[:2]) is None
    assert measured("leader_pdr", PACKETS, "traffic.destination=3") is None, "none of them is meant for the leader"
    assert measured("leader_pdr", PACKETS, "traffic.destination=1") == pytest.approx(2 / 3)


def test_every_delivery_is_in_the_class_of_its_delay() -> None:
    counts = measured("delay_counts", PACKETS)
    assert isinstance(counts, list)
    assert (len(counts), sum(counts)) == (len(DELAY_EDGES_S) + 1, 4)
    for delay_s in (0.02, 0.03, 0.04, 2.0):
        place = next(place for place, edge in enumerate(DELAY_EDGES_S) if edge >= delay_s * 0.999_999)
        assert counts[place] == 1, delay_s
    assert measured("wanted", PACKETS) == 4 * 3


HEARD = [
    Detected(10 * S, 2, 7, -80.0), Detected(12 * S, 3, 8, -80.0), Detected(13 * S, 2, 7, -79.0),
    Detected(14 * S, 3, 7, -80.0), Approaching(15 * S, 4, 7, 3, 0.0, 0.0), Detected(16 * S, 4, 7, -80.0),
    Approaching(18 * S, 4, 8, 3, 0.0, 0.0), Approaching(17 * S, 2, 7, 3, 0.0, 0.0),
]  # fmt: skip


def test_enough_have_heard_when_three_different_uavs_have_heard_the_same_phone() -> None:
    assert measured("enough_heard_s", HEARD) == 16
    assert measured("enough_heard_s", HEARD[:5]) is None


def test_each_uav_counts_once_when_it_first_heard_and_first_turned() -> None:
    assert measured("first_detected_s", HEARD) == [10, 12, 16]
    assert measured("first_approach_s", HEARD) == [15, 17]


def test_the_age_of_information_is_that_of_the_newest_packet_on_average_over_time() -> None:
    """Born at 1 s, there at 2 s; born at 5 s, there at 6 s: (2 + 12 + 12) s^2 in 10 s; a late one changes nothing."""
    settings = ["traffic.sources=[2]", "traffic.destination=1", "warmup_s=0", "duration_s=10", "drain_s=0"]
    born = [sent(2, 1, t_ns=1 * S), sent(2, 2, t_ns=4 * S), sent(2, 3, t_ns=5 * S)]
    came = [
        arrived(2, 1, at=1, delay_ns=S, born_ns=1 * S), arrived(2, 3, at=1, delay_ns=S, born_ns=5 * S),
    ]  # fmt: skip
    late = arrived(2, 2, at=1, delay_ns=4 * S, born_ns=4 * S)
    assert measured("age_s", [*born, *came], *settings) == pytest.approx(2.6)
    assert measured("age_s", [*born, *came, late], *settings) == pytest.approx(2.6)
    assert measured("age_s", born, *settings) == pytest.approx(5.0)
    assert measured("age_s", [], *settings, "traffic.arrivals=none") is None, "who sends nothing has no age"


def test_the_age_of_reports_runs_from_a_reporters_first_to_its_last_over_all_others() -> None:
    """Node 1 hears that of 1 s at 2 s and that of 5 s at 6 s: (0.5 + 12 + 17.5) s^2 in 10 s; 3 and 4 nothing: 50."""
    born = [Generated(t_s * S, 2, seq, "report", 100) for seq, t_s in enumerate((1, 5, 11), 1)]
    came = [arrived(2, 1, at=1, delay_ns=S, born_ns=1 * S), arrived(2, 2, at=1, delay_ns=S, born_ns=5 * S)]
    assert measured("report_age_s", [*born, *came]) == pytest.approx((30 + 50 + 50) / 30)
    assert measured("report_age_s", born[:1]) is None, "one report has no time in which it grows old"
    assert measured("report_age_s", PACKETS) is None

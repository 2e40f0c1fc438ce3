"""Whether a source's bulk is accepted while the swarm is busy."""

from fanet_mw.routing.rounds.admission import BulkAdmission
from fanet_mw.units import NodeId, S

_OWN = NodeId(1)


class _Source:
    """One of ten sources that each want to send two packets a second."""

    def __init__(self, deadline_s: float | None = 4.0) -> None:
        self.admission = BulkAdmission(None if deadline_s is None else round(deadline_s * S))
        self._now_ns = 0

    def live(self, seconds: int, *, others_took_s: float) -> float:
        """The share of own packets that was accepted."""
        accepted = 0
        for _ in range(2 * seconds):
            self._now_ns += S // 2
            for other in range(2, 11):
                self.admission.hear(NodeId(other), round(others_took_s * S), now_ns=self._now_ns)
            accepted += self.admission.admit(_OWN, now_ns=self._now_ns)
        return accepted / (2 * seconds)


def test_nothing_is_refused_while_packets_arrive_well_before_their_deadline() -> None:
    assert _Source().live(20, others_took_s=0.9) == 1.0


def test_a_source_gets_less_than_its_share_once_packets_take_more_than_half_of_the_deadline() -> None:
    source = _Source()
    source.live(5, others_took_s=2.1)
    assert 0.2 < source.live(20, others_took_s=2.1) < 0.8


def test_a_source_is_let_in_again_when_delays_have_fallen() -> None:
    source = _Source()
    source.live(10, others_took_s=3.0)
    source.live(30, others_took_s=0.9)
    assert source.live(10, others_took_s=0.9) == 1.0


def test_without_a_deadline_nothing_is_refused_however_late_packets_are() -> None:
    assert _Source(deadline_s=None).live(20, others_took_s=30.0) == 1.0


def test_delays_that_grow_are_not_steady() -> None:
    source = _Source(deadline_s=None)
    for second in range(8):
        source.live(1, others_took_s=1 + second / 4)
    assert not source.admission.steady
    source.live(10, others_took_s=3.0)
    assert source.admission.steady


def test_own_packets_say_nothing_about_delays() -> None:
    admission = BulkAdmission(4 * S)
    for tenth in range(100):
        admission.admit(_OWN, now_ns=tenth * S // 10)
        if tenth % 5 == 0:
            admission.hear(NodeId(2), 3 * S, now_ns=tenth * S // 10)
    assert admission.interval_ns == 0, "two packets a second are too few to judge by"


def test_sources_that_send_seldom_are_counted_for_ten_seconds() -> None:
    admission = BulkAdmission(4 * S)
    for number in range(100):
        admission.hear(NodeId(2 + number % 50), 3 * S, now_ns=number * S // 10)
    assert 5 * S < admission.interval_ns < 8 * S, "fifty sources share ten packets a second"


def test_an_interval_that_means_nothing_ends() -> None:
    source = _Source()
    source.live(10, others_took_s=3.0)
    source.live(400, others_took_s=0.9)
    assert source.admission.interval_ns == 0


def test_delays_are_steady_however_many_packets_they_are_of() -> None:
    admission = BulkAdmission(None)
    for tenth in range(1, 121):
        for _ in range(tenth):
            admission.hear(NodeId(2), 2 * S, now_ns=tenth * S // 10)
    assert admission.steady

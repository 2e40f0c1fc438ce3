"""What one UAV knows of survivors does not depend on the order in which it is told."""

from hypothesis import given
from hypothesis import strategies as st
from seeing_uav import MODEL

from agents.mission.finding.known_survivors import KnownSurvivors
from fanet_mw.units import S
from fanet_mw.wire.survivors import Found, Standing


@given(st.permutations(range(6)))
def test_confirmations_and_refutations_come_to_the_same_in_any_order(order: list[int]) -> None:
    place = (4.0, 0.0, 4.0)
    words = [
        Found(10, 1, 0.0, 0.0, *place, 9, Standing.CONFIRMED),
        Found(20, 1, 3.0, 0.0, *place, 8, Standing.REFUTED),
        Found(15, 1, 0.0, 5.0, *place, 7, Standing.CONFIRMED),
        Found(12, 1, 57.0, 0.0, *place, 6, Standing.CONFIRMED),
        Found(19, 1, 1.0, 0.0, *place, 5, Standing.ESTIMATED),
        Found(21, 1, 50.0, 0.0, 90.0, 0.0, 90.0, 4, Standing.ESTIMATED),
    ]
    survivors = KnownSurvivors(MODEL)
    for at in [*order, *order]:  # told twice, as floods and hellos do
        survivors.on_found(words[at], now_ns=S)
    confirmed, estimate = survivors.by_id[1].confirmed, survivors.by_id[1].announced
    assert confirmed is not None
    assert confirmed.node == 6, "the only one that was not taken back"
    assert estimate is not None
    assert estimate.node == 4, "an estimate that is not younger than a refutation is part of the mistake"


def test_what_is_confirmed_again_at_the_same_place_after_it_was_taken_back_holds() -> None:
    survivors = KnownSurvivors(MODEL)
    told = Found(10, 1, 0.0, 0.0, 4.0, 0.0, 4.0, 9, Standing.CONFIRMED)
    assert survivors.on_found(told, now_ns=S)
    assert survivors.on_found(told._replace(t_us=20, standing=Standing.REFUTED), now_ns=S)
    assert not survivors.on_found(told, now_ns=S)
    assert survivors.on_found(told._replace(t_us=30), now_ns=S)
    assert survivors.is_confirmed(1)

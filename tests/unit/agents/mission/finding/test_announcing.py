"""Announcing: a confirmation is told often enough, and by few."""

import math

import pytest
from search_board import FOLLOWER, MODEL, UP_M, Board

from agents.mission.finding.phone_localization import REFERENCE_LOSS_DB, Estimate
from fanet_mw.trace import Confirmed, Refuted
from fanet_mw.units import Enu, NodeId, S
from fanet_mw.wire.search_messages import told_in
from fanet_mw.wire.survivors import Found, Standing, Survivor


def estimated(board: Board) -> list[Found]:
    """The estimates that were flooded."""
    told = [message for packet in board.out.packets for message in told_in(bytes(36) + packet.frames)]
    return [message for message in told if isinstance(message, Found) and message.standing is Standing.ESTIMATED]


def confirmed(board: Board) -> list[Found]:
    """The confirmations that were flooded."""
    told = [message for packet in board.out.packets for message in told_in(bytes(36) + packet.frames)]
    return [message for message in told if isinstance(message, Found) and message.standing is Standing.CONFIRMED]


def seen() -> Board:
    board = Board(FOLLOWER, Enu(0, 0, UP_M))
    for node in range(1, 5):
        for east in (-60, 0, 60):
            at = Enu(east, 20.0 * node, UP_M)
            rssi_dbm = MODEL.power_dbm - REFERENCE_LOSS_DB - 30 * math.log10(at.norm())
            board.survivors.take_report(Survivor(0, 1, node, at, rssi_dbm), now_ns=0)
    board.survivors.by_id[1].filter.on_sighting(Estimate(1, 2, 4, 0, 4))
    return board


def test_a_confirmation_is_told_three_times_and_with_hellos_for_a_while() -> None:
    board = seen()
    board.announcing.confirm(1, 0)
    for second in range(30):
        board.announcing.tell(None, second * S)
    assert len(confirmed(board)) == 3
    assert [type(record) for record in board.out.records] == [Confirmed]
    assert len(told_in(bytes(36) + board.announcing.hello_frames(11 * S))) == 1
    assert board.announcing.hello_frames(13 * S) == b""


def test_who_still_reports_a_confirmed_survivor_is_told_by_one_in_four() -> None:
    board = seen()
    board.announcing.confirm(1, 0)
    report = Survivor(0, 1, 0, Enu(0, 0, UP_M), -70.0)
    for reporter in range(10, 14):
        board.announcing.reported(report._replace(reporter=reporter), reporter * 8 * S)
    assert len(confirmed(board)) == 1


def test_a_refutation_is_told_as_a_confirmation_is_and_answers_who_tells_the_confirmation_again() -> None:
    board = seen()
    board.announcing.confirm(1, 0)
    mistaken = board.survivors.by_id[1].confirmed
    assert mistaken is not None
    board.announcing.refute(1, S)
    board.out.packets.clear()
    for second in range(1, 30):
        board.announcing.tell(None, second * S)
    told = [message for packet in board.out.packets for message in told_in(bytes(36) + packet.frames)]
    assert [message.standing for message in told if isinstance(message, Found)] == [Standing.REFUTED] * 3
    assert [type(record) for record in board.out.records] == [Confirmed, Refuted]
    assert board.announcing.hello_frames(12 * S) != b""
    board.out.packets.clear()
    for node in range(10, 14):
        board.announcing.outdated(mistaken._replace(node=node), node * 8 * S)
    assert len(board.out.packets) == 1


def test_who_hears_a_lost_one_again_floods_all_verdicts_once_but_those_that_were_flooded_just_now() -> None:
    board = seen()
    others = {survivor: Found(1, survivor, 10.0, 20.0, 4, 0, 4, 7, Standing.CONFIRMED) for survivor in (2, 3)}
    board.announcing.confirm(1, 0)
    for found in others.values():
        board.survivors.on_found(found, now_ns=0)
        board.announcing.decided(found.survivor, 0)
    for second in range(30):
        board.announcing.tell(None, second * S)
    board.out.packets.clear()
    board.announcing.on_returned(40 * S)
    board.announcing.repeated(others[3], 40 * S)
    for second in range(40, 50):
        board.announcing.tell(None, second * S)
    assert sorted(found.survivor for found in confirmed(board)) == [1, 2]


@pytest.mark.parametrize("other", [Standing.INSIDE, Standing.AMONG, Standing.REFUTED])
def test_who_hears_a_lost_one_again_floods_a_verdict_of_which_somebody_floods_another_one(other: Standing) -> None:
    board = seen()
    board.announcing.confirm(1, 10 * S)
    for second in range(10, 40):
        board.announcing.tell(None, second * S)
    board.out.packets.clear()
    held = board.survivors.verdict(1)
    assert held is not None
    board.announcing.on_returned(40 * S)
    board.announcing.repeated(held._replace(t_us=5, standing=other), 40 * S)
    board.announcing.tell(None, 42 * S)
    assert [found.survivor for found in confirmed(board)] == [1], "the other part does not know the confirmation"


def test_those_who_hear_it_take_turns() -> None:
    began = set()
    for node in range(1, 7):
        board = Board(NodeId(node), Enu(0, 0, UP_M))
        board.survivors.on_found(Found(1, 2, 10.0, 20.0, 4, 0, 4, 7, Standing.CONFIRMED), now_ns=0)
        board.announcing.decided(2, 0)
        board.announcing.on_returned(20 * S)
        steps = [20 * S + step * S // 20 for step in range(60)]
        for now_ns in steps:
            board.announcing.tell(None, now_ns)
            if confirmed(board):
                began.add(now_ns)
                break
    assert len(began) == 6


@pytest.mark.parametrize(
    ("hears_it", "told_m", "tells"),
    [(True, None, 1), (True, 90.0, 1), (True, 5.0, 0), (False, None, 0)],
    ids=["nobody has told", "somebody knows less", "somebody knows as much", "has not received the phone"],
)
def test_who_receives_a_phone_and_places_it_best_tells_its_estimate_once_whoever_responds(
    hears_it: bool, told_m: float | None, tells: int
) -> None:
    board, truth = Board(FOLLOWER, Enu(0, 0, UP_M)), Enu(100, 20, 0)
    board.hear(1, truth, range(1, 5), now_ns=0)
    if hears_it:
        board.hear(1, truth, range(FOLLOWER, FOLLOWER + 1), now_ns=0)
    if told_m is not None:
        told = Found(1, 1, 150, 20, told_m**2, 0, told_m**2, NodeId(3), Standing.ESTIMATED)
        board.survivors.on_found(told, now_ns=0)
    for second in range(5):
        board.announcing.tell(None, second * S)
    assert len(estimated(board)) == tells

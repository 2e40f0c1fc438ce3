"""The inbox of a real-time host: bounded, fair among topics, and every put is counted once."""

import threading
from array import array

from hypothesis import given
from hypothesis import strategies as st

from fanet_mw.bus import codecs
from fanet_mw.bus.messages import MavlinkTap, Message, Poses, Report, TraceBatch
from fanet_mw.bus.radio_control import Restore
from fanet_mw.hosts.inbox import BOUND, BOUND_BYTES, PORTION, Inbox

TAP = codecs.encode([MavlinkTap(1, b"x")])


def delivered(inbox: Inbox, *, most: int = PORTION) -> list[str]:
    heard: list[str] = []

    def receive(topic: str, _message: Message) -> None:
        heard.append(topic)

    inbox.deliver(receive, most=most)
    return heard


@given(st.lists(st.one_of(st.sampled_from(["a", "b", "c"]), st.none(), st.integers(1, 9)), max_size=200))
def test_every_put_is_taken_malformed_overflowed_or_waiting_and_none_overtakes(script: list[str | int | None]) -> None:
    """A script of puts of several messages on topics, malformed puts (None) and turns of so many messages."""
    inbox = Inbox(bound=12)
    offered: list[str] = []
    heard: list[str] = []
    for number, step in enumerate(script):
        if isinstance(step, int):
            found = delivered(inbox, most=step)
            assert len(found) <= step
            heard += found
        else:
            before, messages = inbox.overflowed, number % 4
            inbox.offer(step or "a", TAP * messages if step else b"\xff")
            if step and inbox.overflowed == before:
                offered += [step] * messages
        figures = inbox.figures()
        assert figures["waiting"] <= 13, "those that wait, and one that is open"
        rest = figures["taken"] + figures["malformed"] + figures["overflowed"] + figures["waiting"]
        assert figures["samples"] == rest
    heard += delivered(inbox)
    assert heard == offered
    assert inbox._all.bytes_in == inbox._all.bytes_gone


def test_one_topic_that_floods_leaves_room_for_the_others() -> None:
    inbox = Inbox()
    for _ in range(10 * BOUND):
        inbox.offer("flood", TAP)
    assert inbox.figures()["waiting"] == BOUND // 4
    assert inbox.figures()["share_full"] == inbox.overflowed == 10 * BOUND - BOUND // 4
    for i in range(100):
        inbox.offer(f"calm-{i}", TAP)
    assert inbox.figures()["waiting"] == BOUND // 4 + 100
    while len(found := delivered(inbox)) == PORTION:
        pass
    assert found[-1] == "calm-99"
    inbox.offer("flood", TAP)
    assert delivered(inbox) == ["flood"], "its share is free again"


def test_more_topics_than_there_can_be_share_one_quota() -> None:
    inbox = Inbox(bound=100_000)
    for i in range(60_000):
        inbox.offer(f"{i}", TAP)
    assert inbox.figures()["waiting"] == 8192 + 25_000
    for i in range(100_000):
        inbox.offer(f"{i % 8000}", TAP)
    assert inbox.figures()["waiting"] == 100_000
    assert inbox.inbox_full == 100_000 - (100_000 - 8192 - 25_000)
    assert len(inbox._usages) <= 8193


def test_a_put_of_many_messages_is_handed_over_in_turns() -> None:
    inbox = Inbox()
    inbox.offer("a", TAP * 1000)
    inbox.offer("b", TAP)
    turns = [delivered(inbox) for _ in range(4)]
    assert [len(turn) for turn in turns] == [PORTION, PORTION, PORTION, 1001 - 3 * PORTION]
    assert turns[-1][-1] == "b"
    assert inbox.taken == 2


def test_a_turn_ends_after_so_many_bytes() -> None:
    inbox = Inbox()
    long = codecs.encode([MavlinkTap(1, b"x" * 100_000)])
    for _ in range(9):
        inbox.offer("a", long)
    assert len(delivered(inbox)) == 3
    assert len(delivered(inbox)) == 3


def test_what_waits_is_bounded_in_bytes_whatever_it_says() -> None:
    """Puts of 5 MB are not even kept, and of shorter ones a quarter of the room is what one topic may have."""
    inbox = Inbox()
    for _ in range(4):
        inbox.offer("flood", TAP * 350_000)
    assert inbox.oversized == 4
    for i in range(100):
        inbox.offer("flood", b"x" * 1_000_000)
        inbox.offer(f"crowd-{i}", b"x" * 1_000_000)
    assert inbox._all.bytes_in <= BOUND_BYTES
    assert inbox.figures()["waiting"] == BOUND_BYTES // 1_000_000
    assert inbox.share_full == 8, "four of one topic were kept while the others brought their twelve"
    assert delivered(inbox) == []
    assert inbox.malformed == BOUND_BYTES // 1_000_000
    inbox.offer("flood", TAP)
    assert delivered(inbox) == ["flood"], "the room is free again"


def test_more_messages_in_a_put_than_anyone_means_are_malformed() -> None:
    inbox = Inbox()
    inbox.offer("a", codecs.encode([Restore("")] * codecs.MAX_ITEMS))
    inbox.offer("a", codecs.encode([Restore("")] * (codecs.MAX_ITEMS + 1)))
    heard = 0
    while found := delivered(inbox):
        assert len(found) <= PORTION
        heard += len(found)
    assert heard == codecs.MAX_ITEMS
    assert (inbox.taken, inbox.malformed) == (1, 1)


def test_text_for_collectors_is_not_decoded_for_an_actor() -> None:
    inbox = Inbox()
    inbox.offer("a", codecs.encode([Report("x", 1, "{}")]))
    inbox.offer("a", codecs.encode([TraceBatch(())]))
    assert delivered(inbox) == []
    assert inbox.malformed == 2


def test_two_threads_at_its_two_ends_lose_nothing() -> None:
    """What the bus delivers while the actor takes it."""
    inbox = Inbox(bound=64)
    heard: list[Message] = []
    puts = [codecs.encode([Poses(i, array("H"), array("d"))]) for i in range(20_000)]

    def bus() -> None:
        for payload in puts:
            inbox.offer("pose", payload)

    thread = threading.Thread(target=bus)
    thread.start()
    while thread.is_alive():
        inbox.deliver(lambda _, message: heard.append(message))
    thread.join()
    inbox.deliver(lambda _, message: heard.append(message))
    instants = [message.t_ns for message in heard if isinstance(message, Poses)]
    assert instants == sorted(instants)
    assert len(instants) == inbox.taken == 20_000 - inbox.overflowed

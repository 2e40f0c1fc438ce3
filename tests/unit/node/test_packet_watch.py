"""What becomes of own packets that an application wants to know of."""

from fanet_mw.errors import DropReason
from fanet_mw.node.packet_watch import PacketNews, PacketWatch, RadioStage


def watch(*packets: int, radio: bool = True) -> PacketWatch:
    made = PacketWatch()
    for seq in packets:
        made.begin(seq, radio=radio)
    return made


def test_a_status_tells_of_all_packets_in_the_frame() -> None:
    watched = watch(7, 8, 9)
    assert all(watched.announced(seq, 30, 5) for seq in (7, 8))
    watched.news.clear()
    watched.radio_done(30, tried=True, now_ns=6)
    assert watched.news == [PacketNews(7, 6, RadioStage.SENT), PacketNews(8, 6, RadioStage.SENT)]


def test_only_the_first_frame_of_a_packet_is_reported_on() -> None:
    watched = watch(7)
    assert watched.announced(7, 30, 5)
    assert not watched.announced(7, 31, 6)
    watched.news.clear()
    for request in (31, 30, 30):
        watched.radio_done(request, tried=False, now_ns=8)
    assert watched.news == [PacketNews(7, 8, RadioStage.NOT_TRIED)]


def test_of_a_packet_that_is_watched_no_longer_nothing_is_said() -> None:
    watched = watch(7, 8)
    watched.announced(7, 30, 5)
    watched.news.clear()
    for seq in (7, 8):
        watched.end(seq)
    watched.radio_done(30, tried=True, now_ns=6)
    watched.dropped(7, DropReason.EXPIRED, 6)
    assert not watched.announced(8, 31, 6)
    assert watched.news == []


def test_without_the_radio_a_packet_is_announced_and_dropped() -> None:
    watched = watch(7, radio=False)
    assert not watched.announced(7, 30, 5)
    watched.dropped(7, DropReason.QUEUE_FULL, 6)
    watched.dropped(8, DropReason.QUEUE_FULL, 6)
    assert watched.news == [PacketNews(7, 5, RadioStage.ANNOUNCED), PacketNews(7, 6, DropReason.QUEUE_FULL)]


def test_statuses_that_never_come_are_forgotten() -> None:
    watched = watch(*range(5000))
    for seq in range(5000):
        watched.announced(seq, seq, 0)
    assert len(watched._on_radio) == 1024
    watched.news.clear()
    watched.radio_done(4999, tried=True, now_ns=6)
    assert len(watched.news) == 1

"""A few seconds of both fuzzers (`scripts/fuzz` is the long run), and that they would notice."""

from random import Random

import air
import corpus
import decoders
import pytest
from decoders import Decoder, Wrong

from fanet_mw.errors import MalformedFrameError

INPUTS = 300
TELLING = ("aodv", "olsr", "dsdv", "geographic", "all", "relay-counter", "measured", "claimed")
"""Swarms that say, together, every kind of message."""


@pytest.fixture(scope="module")
def every(tmp_path_factory: pytest.TempPathFactory) -> list[Decoder]:
    return decoders.decoders_of(corpus.recorded(swarms=TELLING), tmp_path_factory.mktemp("fuzz"))


def test_no_near_miss_of_anything_valid_is_more_than_one_error(every: list[Decoder]) -> None:
    wrong: list[Wrong] = []
    for decoder in every:
        found, bad = decoders.feed(decoder, INPUTS, Random(decoder.name))
        wrong += bad
        assert found.values < INPUTS, f"no input of {decoder.name} is refused"
    assert wrong == [], "\n".join(map(str, wrong))


def test_most_decoders_are_brought_beyond_their_checksums(every: list[Decoder]) -> None:
    values = [decoders.feed(decoder, 50, Random(decoder.name))[0].values for decoder in every]
    assert sum(count > 0 for count in values) >= len(every) - 2, dict(zip(every, values, strict=True))


def raises(data: bytes) -> object:
    return {}[data]


def takes_long(data: bytes) -> object:
    return sum(range(2_000_000))


def refuses(data: bytes) -> object:
    raise MalformedFrameError("no")


@pytest.mark.parametrize(("decode", "told"), [(raises, "KeyError"), (takes_long, "took "), (refuses, None)])
def test_an_input_that_a_decoder_does_not_stand_is_told_with_its_bytes(decode, told, monkeypatch) -> None:
    monkeypatch.setattr(decoders, "SLOW_S", 0.005)
    _, wrong = decoders.feed(Decoder("planted", decode, lambda _: b"\x07"), 1, Random(0))
    assert [told in str(item) and "fromhex('07')" in str(item) for item in wrong] == [True] * (told is not None)


@pytest.mark.parametrize("name", corpus.SETTINGS)
def test_a_swarm_in_which_one_node_sends_near_misses_goes_on_and_accounts_for_all(name: str) -> None:
    result = air.run(name, 0, seconds=5.0, limit_s=60)
    assert result.wrong == ""
    assert result.frames > 40


def test_the_same_seed_is_the_same_run() -> None:
    assert air.run("claimed", 4, seconds=2).trace == air.run("claimed", 4, seconds=2).trace

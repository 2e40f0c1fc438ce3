"""A few seconds of both fuzzers (`scripts/fuzz` is the long run), and that they would notice."""

import ast
import re
import sys
from pathlib import Path
from random import Random
from types import FrameType

import air
import corpus
import decoders
import pytest
from decoders import Decoder, Wrong

from fanet_mw.errors import MalformedFrameError

ROOT = Path(__file__).parents[2]
PACKAGES = ("fanet_mw", "agents", "emulator", "sim")
INPUTS = 150
TELLING = ("rounds", "aodv", "olsr", "dsdv", "geographic", "all", "relay-counter", "measured")
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


def decode_functions() -> set[tuple[str, str]]:
    """File and qualified name of every function of ours that, by its name, decodes what others send."""
    found = set()
    for path in (path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        text = path.read_text()
        if path.parent == ROOT / "fanet_mw/dialect" or not re.search(r"def _?decode(_|\()", text):
            continue  # the dialect is generated: a parser of pymavlink
        for scope in ast.walk(ast.parse(text)):
            if isinstance(scope, ast.Module | ast.ClassDef):
                within = f"{scope.name}." if isinstance(scope, ast.ClassDef) else ""
                functions = [item for item in scope.body if isinstance(item, ast.FunctionDef)]
                names = [one.name for one in functions if re.match("_?decode(_|$)", one.name)]
                found |= {(str(path), within + name) for name in names}
    return {(path, name) for path, name in found if name != "decode_time"}  # of a number that is decoded already


def test_every_decode_function_of_ours_is_fed(every: list[Decoder]) -> None:
    called: set[tuple[str, str]] = set()

    def note(frame: FrameType, event: str, _argument: object) -> None:
        if event == "call" and "decode" in frame.f_code.co_name:
            called.add((frame.f_code.co_filename, frame.f_code.co_qualname))

    sys.setprofile(note)
    try:
        for decoder in every:
            decoders.feed(decoder, 30, Random(decoder.name))
    finally:
        sys.setprofile(None)
    wanted = decode_functions()
    assert len(wanted) > 40
    assert wanted - called == set()


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
    assert air.run("measured", 4, seconds=2).trace == air.run("measured", 4, seconds=2).trace

"""Nothing that a swarm does has changed, unless on purpose."""

import json

import pytest
from kept_flights import FILE, FLIGHTS, parts


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_flight_comes_to_what_it_came_to_before(name: str) -> None:
    kept, found = json.loads(FILE.read_text())[name], dict(parts(name))
    changed = {part: (kept.get(part), found.get(part)) for part in {*kept, *found} if kept.get(part) != found.get(part)}
    assert not changed, "on purpose? then kept_flights.py --write, and say why in the commit"


def test_every_kept_flight_is_flown_and_its_ledgers_close() -> None:
    kept = json.loads(FILE.read_text())
    assert list(kept) == list(FLIGHTS)
    assert {name for name, parts_of in kept.items() if parts_of["ledgers close"] != "True"} == set()

"""Who of a swarm is there, twice, missing, or with another scenario."""

import json

import pytest

from fanet_mw.bus.topics import Topics
from fanet_mw.errors import BusError
from fanet_mw.hosts.presence import Presence
from fanet_mw.scenario.fingerprint import as_json, differences, fingerprint, told_by
from sim.scenarios import catalog

NAMES = Topics("s")


def presence(*expected: str) -> Presence:
    return Presence(NAMES, expected, fingerprint="aaaa")


def token(name: str, scenario: str = "aaaa", instance: str = "1") -> str:
    return NAMES.alive(name, fingerprint=scenario, instance=instance)


def test_a_swarm_is_complete_when_everyone_is_there_once() -> None:
    swarm = presence("world", "agent-1")
    assert swarm.missing() == ["agent-1", "world"]
    swarm.on_token(token("agent-1"), alive=True)
    assert not swarm.complete()
    swarm.on_token(token("world"), alive=True)
    assert swarm.complete()
    assert swarm.sentence() == ""
    swarm.on_token(token("world"), alive=False)
    assert swarm.missing() == ["world"]


def test_an_id_twice_is_named_until_one_of_them_goes() -> None:
    swarm = presence("agent-1")
    for instance in ("1", "2"):
        swarm.on_token(token("agent-1", instance=instance), alive=True)
    assert not swarm.complete()
    assert swarm.sentence() == "there twice: agent-1"
    swarm.on_token(token("agent-1", instance="1"), alive=False)
    assert swarm.complete()


def test_a_process_with_another_scenario_does_not_count_and_is_named() -> None:
    swarm = presence("agent-1", "agent-2")
    swarm.on_token(token("agent-1", scenario="bbbb"), alive=True)
    swarm.on_token(token("agent-13"), alive=True)
    assert swarm.sentence() == (
        "missing: agent-1, agent-2; with another scenario: agent-1; not of this scenario: agent-13"
    )


def test_a_process_of_somebody_else_is_taken_at_its_word() -> None:
    swarm = presence("world")
    swarm.on_token(NAMES.alive("world"), alive=True)
    assert swarm.complete()


def test_the_fingerprint_is_of_every_value_and_differences_are_named() -> None:
    one, same = catalog.find("quick"), catalog.find("quick")
    other = catalog.find("quick", ["routing.protocol=flooding", "nodes.count=12"])
    assert fingerprint(one) == fingerprint(same)
    assert fingerprint(one) != fingerprint(other)
    found = list(differences(one.model_dump(mode="json"), other.model_dump(mode="json")))
    assert found == [("nodes.count", 9, 12), ("routing.protocol", "clustered", "flooding")]


def test_who_lays_bus_messages_out_otherwise_is_no_keeper_for_this_process() -> None:
    told = json.loads(as_json(catalog.find("quick")))
    assert told_by("s", json.dumps(told).encode()) == {key: told[key] for key in told.keys() - {"bus"}}
    with pytest.raises(BusError, match="swarm s lays bus messages out as 'older', this fanet-mw as "):
        told_by("s", json.dumps({**told, "bus": "older"}).encode())
    del told["bus"]
    assert told_by("s", json.dumps(told).encode()) == told, "a keeper of somebody else need not say it"

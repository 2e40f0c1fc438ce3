"""Faults drawn by the seed: which UAVs crash, fall mute, or lose their program, and when (`--faults random:N`)."""

import re
from typing import Any, Final

from fanet_mw.errors import ConfigError
from fanet_mw.rng import stream
from fanet_mw.scenario import config
from fanet_mw.scenario.model import Scenario

_KINDS: Final = ("crash", "mute", "stop")
_FROM_S: Final = 30.0
"""The first instant at which a fault may begin, or a quarter of a shorter run."""
_UNTIL: Final = 0.8
"""The share of the run after which none begins any more, so that it is seen what becomes of it."""


def with_drawn_faults(scenario: Scenario, asked: str) -> Scenario:
    """The scenario with as many faults as `random:N` asks for, each of another UAV; raises ConfigError."""
    count, found = scenario.nodes.count, re.fullmatch(r"random:([0-9]{1,6})", asked)
    if found is None or not 1 <= int(found[1]) < count:
        raise ConfigError(f"--faults {asked}: must be random:N, with 1 <= N < nodes.count = {count}")
    random = stream(scenario.seed, "drawn faults")
    first_s = min(_FROM_S, scenario.duration_s / 4)
    drawn: list[dict[str, Any]] = [
        {
            "kind": random.choice(_KINDS),
            "node": node,
            "at_s": round(random.uniform(first_s, _UNTIL * scenario.duration_s), 1),
        }
        for node in random.sample(list(scenario.uav_ids), int(found[1]))
    ]
    tree = scenario.model_dump(mode="json", exclude_none=True)
    return config.build({**tree, "faults": [*tree["faults"], *sorted(drawn, key=lambda fault: fault["at_s"])]})

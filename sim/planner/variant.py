"""A scenario with some settings changed, and how great the change is.

Settings are keys of the scenario, so the planner's proposals can be applied: `arguments` are arguments of `--set`.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from fanet_mw.errors import ConfigError
from fanet_mw.scenario import Scenario, config

Value = float | int | str


class Variant(NamedTuple):
    """A valid scenario, and the settings that were changed to obtain it."""

    scenario: Scenario
    settings: tuple[tuple[str, Value], ...]
    octaves: float
    """The sum over all changed numbers of |log2(new / old)|."""

    @property
    def arguments(self) -> tuple[str, ...]:
        """KEY=VALUE for each setting."""
        return tuple(f"{key}={_text(value)}" for key, value in self.settings)

    @property
    def size(self) -> tuple[int, float, tuple[str, ...]]:
        """The number of keys, then octaves; then the arguments, to break ties."""
        return len(self.settings), self.octaves, self.arguments


def vary(scenario: Scenario, settings: Mapping[str, Value]) -> Variant | None:
    """The scenario with these settings; None if it is not valid, or if nothing differs."""
    tree = scenario.model_dump(exclude_none=True)
    changed: list[tuple[str, Value]] = []
    octaves = 0.0
    for key, value in settings.items():
        *path, last = key.split(".")
        table = tree
        for part in path:
            inner = table[part]
            table = inner[0] if isinstance(inner, list) else inner  # the first of several classes of traffic
        old = table.get(last)
        if old == value:
            continue
        changed.append((key, value))
        if isinstance(old, float | int) and not isinstance(value, str):
            octaves += abs(math.log2(value / old)) if old > 0 and value > 0 else 1.0
        table[last] = value
    if not changed:
        return None
    try:
        return Variant(config.build(tree), tuple(changed), octaves)
    except ConfigError:
        return None


def _text(value: Value) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"

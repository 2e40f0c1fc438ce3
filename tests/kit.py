"""What test modules import from here: how many examples a property is tried with, and types of fixtures.

They do not import `conftest.py`, which pytest has read already: a second time it would load its default profile again,
whatever profile was asked for.
"""

from collections.abc import Callable
from typing import Any, Final

from hypothesis import settings

from fanet_mw.scenario import Scenario

MakeScenario = Callable[..., Scenario]

DEFAULT_EXAMPLES: Final = 30
"""Of a property that says nothing else, in a default run."""


def examples(count: int, **more: Any) -> settings:
    """So many examples in a default run, and as many times more in `scripts/test --all` as its profile has."""
    return settings(max_examples=max(1, count * settings().max_examples // DEFAULT_EXAMPLES), **more)

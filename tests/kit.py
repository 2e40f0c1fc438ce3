"""What test modules import from here: how many examples a property is tried with, and types of fixtures.

They do not import `conftest.py`, which pytest has read already: a second time it would load its default profile again,
whatever profile was asked for.
"""

from collections.abc import Callable
from typing import Any, Final

import pytest
from hypothesis import settings

from fanet_mw.scenario import Scenario

MakeScenario = Callable[..., Scenario]

DEFAULT_EXAMPLES: Final = 30
"""Of a property that says nothing else, in a default run."""


def examples(count: int, **more: Any) -> settings:
    """So many examples in a default run, and as many times more in `scripts/test --all` as its profile has."""
    return settings(max_examples=max(1, count * settings().max_examples // DEFAULT_EXAMPLES), **more)


def slow(*values: Any) -> list[Any]:
    """Parameters of a test that only `scripts/test --all` tries; each is one value, or a tuple of them."""
    return [pytest.param(*(one if isinstance(one, tuple) else (one,)), marks=pytest.mark.slow) for one in values]

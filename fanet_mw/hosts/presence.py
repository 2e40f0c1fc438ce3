"""The processes of a swarm that are present, as their liveliness tokens show, and which are missing or wrong.

fanet/<swarm>/alive/<name>/<fingerprint>/<instance>    a process of this project, its scenario, and its instance
fanet/<swarm>/alive/<name>                             a process of another program, whose scenario is not checked
"""

from collections.abc import Iterable

from fanet_mw.bus.topics import Topics
from fanet_mw.scenario import Scenario

_NAMED = 5


def few(names: Iterable[str]) -> str:
    """The first five of the names, and the number of the others."""
    found = list(names)
    return ", ".join(found[:_NAMED]) + (f" and {len(found) - _NAMED} more" if len(found) > _NAMED else "")


def expected_names(scenario: Scenario) -> list[str]:
    """The processes of a swarm."""
    return ["emulator", "world", *(f"agent-{node}" for node in scenario.node_ids)]


class Presence:
    """The expected and the present processes. Without a fingerprint, any scenario is accepted."""

    def __init__(self, names: Topics, expected: Iterable[str], *, fingerprint: str | None = None) -> None:
        self._prefix = names.alive("")
        self._fingerprint = fingerprint
        self._expected = tuple(expected)
        self._tokens: dict[str, set[str]] = {}
        """The rest of each token, by the name of its process."""

    def on_token(self, topic: str, *, alive: bool) -> None:
        name, _, rest = topic.removeprefix(self._prefix).partition("/")
        tokens = self._tokens.setdefault(name, set())
        if alive:
            tokens.add(rest)
        else:
            tokens.discard(rest)

    def missing(self) -> list[str]:
        """The expected processes that are not present with this scenario."""
        return sorted(name for name in self._expected if not self._right(name))

    def twice(self) -> list[str]:
        """The processes that are present more than once."""
        return sorted(name for name in self._tokens if len(self._right(name)) > 1)

    def complete(self) -> bool:
        """True if all expected processes are present, each of them once."""
        return not self.missing() and not self.twice()

    def sentence(self) -> str:
        """A sentence on what is wrong; empty if nothing is."""
        there = sorted(self._tokens.items())
        parts = {
            "missing": self.missing(),
            "there twice": self.twice(),
            "with another scenario": [name for name, tokens in there if len(self._right(name)) < len(tokens)],
            "not of this scenario": [name for name, tokens in there if tokens and name not in self._expected],
        }
        return "; ".join(f"{what}: {few(names)}" for what, names in parts.items() if names)

    def _right(self, name: str) -> set[str]:
        """The tokens of a process that state this scenario, or none."""
        tokens = self._tokens.get(name, set())
        if self._fingerprint is None:
            return tokens
        return {rest for rest in tokens if not rest or rest.partition("/")[0] == self._fingerprint}

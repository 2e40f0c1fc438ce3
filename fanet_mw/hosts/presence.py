"""The processes of a swarm that are present, by liveliness tokens, and what is wrong with them.

fanet/<swarm>/alive/<name>/<fingerprint>/<instance>    a process of fanet-mw: which scenario, and which of several
fanet/<swarm>/alive/<name>                             a process of another program, taken at its word
"""

from collections.abc import Iterable

from fanet_mw.bus.topics import Topics

_NAMED = 5


def few(names: Iterable[str]) -> str:
    """The first five of the names, and how many more there are."""
    found = list(names)
    return ", ".join(found[:_NAMED]) + (f" and {len(found) - _NAMED} more" if len(found) > _NAMED else "")


class Presence:
    """The processes that are expected and those that are present; without a fingerprint any scenario is right."""

    def __init__(self, names: Topics, expected: Iterable[str], *, fingerprint: str | None = None) -> None:
        self._prefix = names.alive("")
        self._fingerprint = fingerprint
        self._expected = tuple(expected)
        self._tokens: dict[str, set[str]] = {}
        """The rest of each token, by the name of the process."""

    def on_token(self, topic: str, *, alive: bool) -> None:
        """Take in that a token has appeared or gone."""
        name, _, rest = topic.removeprefix(self._prefix).partition("/")
        tokens = self._tokens.setdefault(name, set())
        if alive:
            tokens.add(rest)
        else:
            tokens.discard(rest)

    def missing(self) -> list[str]:
        """The processes that are expected and not present with this scenario."""
        return sorted(name for name in self._expected if not self._right(name))

    def twice(self) -> list[str]:
        """The processes that are present more than once."""
        return sorted(name for name in self._tokens if len(self._right(name)) > 1)

    def of_another_scenario(self) -> list[str]:
        """The processes that run another scenario under the name of this swarm."""
        return sorted(name for name, tokens in self._tokens.items() if len(self._right(name)) < len(tokens))

    def unexpected(self) -> list[str]:
        """The processes for which this scenario has no place."""
        return sorted(name for name, tokens in self._tokens.items() if tokens and name not in self._expected)

    def complete(self) -> bool:
        """True if all expected processes are present, each of them once."""
        return not self.missing() and not self.twice()

    def sentence(self) -> str:
        """A sentence for people on what is wrong; empty when nothing is."""
        parts = {
            "missing": self.missing(),
            "there twice": self.twice(),
            "with another scenario": self.of_another_scenario(),
            "not of this scenario": self.unexpected(),
        }
        return "; ".join(f"{what}: {few(names)}" for what, names in parts.items() if names)

    def _right(self, name: str) -> set[str]:
        """The tokens of a name that state this scenario, or state none."""
        tokens = self._tokens.get(name, set())
        if self._fingerprint is None:
            return tokens
        return {rest for rest in tokens if not rest or rest.partition("/")[0] == self._fingerprint}

"""The kernel is compiled ahead of its first use, all of it: what is left out stalls the first run for a second."""

from collections.abc import Callable

import pytest

from emulator.kernel import kernel
from emulator.kernel.compile import warm_up

ENTRIES = ("take_in", "next_output", "scatter", "relink")


def test_warming_up_runs_what_moves_links_under_a_frame_on_the_air_too(monkeypatch: pytest.MonkeyPatch) -> None:
    run: set[str] = set()

    def noting(name: str, entry: Callable[..., object]) -> Callable[..., object]:
        def noted(*arguments: object) -> object:
            run.add(name)
            return entry(*arguments)

        return noted

    for name in ENTRIES:
        monkeypatch.setattr(kernel, name, noting(name, getattr(kernel, name)))
    warm_up()
    assert run == {*ENTRIES}

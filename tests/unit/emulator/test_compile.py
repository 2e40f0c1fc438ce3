"""The kernel is compiled ahead of its first use, all of it: what is left out stalls the first run for a second."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from emulator.compile_kernel import warm_up
from emulator.kernel import jit, kernel
from emulator.kernel.jit import first_writable

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


def test_machine_code_is_kept_in_the_first_folder_that_can_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert first_writable([tmp_path / "file" / "a", tmp_path / "b" / "c", tmp_path]) == tmp_path / "b" / "c"
    assert first_writable([tmp_path / "file" / "a", Path("/proc/none")]) is None


def test_each_state_of_the_sources_has_a_folder_of_its_own_also_in_the_users_home(tmp_path: Path) -> None:
    """A read-only clone that is updated: the sources differ, the home is the same."""
    package = Path(__file__).parents[3] / "emulator"
    for path in package.rglob("*.py"):
        copy = tmp_path / "clone" / "emulator" / path.relative_to(package)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    (tmp_path / "clone" / "emulator" / "__pycache__").write_text("not writable, not even by root")

    def folder() -> Path:
        program = "from emulator.kernel import jit; print(jit.cache_folder())"
        environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "home"), "PYTHONDONTWRITEBYTECODE": "1"}
        environment.pop("NUMBA_CACHE_DIR", None)
        ended = subprocess.run(
            [sys.executable, "-c", program], cwd=tmp_path / "clone", env=environment, capture_output=True, text=True,
            timeout=60, check=True,
        )  # fmt: skip
        return Path(ended.stdout.strip())

    before = folder()
    changed = tmp_path / "clone" / "emulator" / "kernel" / "frame_exchange.py"
    changed.write_text(changed.read_text() + "\n_NEW = 1\n")
    after = folder()
    assert before.parent == after.parent == tmp_path / "home" / "fanet-mw"
    assert before != after


def test_where_nothing_can_be_written_the_kernel_runs_without_a_cache() -> None:
    program = "from emulator.kernel import jit, kernel; print(jit.cache_folder(), jit.COMPILED)"
    ended = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, "NUMBA_CACHE_DIR": "/dev/null/x"}, capture_output=True,
        text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (ended.stdout, ended.stderr) == (f"None {jit.COMPILED}\n", "")


@pytest.mark.parametrize(
    ("variable", "said"),
    [
        ({"NUMBA_DISABLE_JIT": "1"}, "False"),
        ({"NUMBA_NUM_THREADS": "0"}, "numba is installed and cannot be imported: Number of threads specified must be"),
        ({"PYTHONPATH": "{}"}, "numba is installed and cannot be imported: needs another numpy; it reads"),
    ],
)
def test_a_numba_that_is_told_not_to_compile_does_not_and_one_that_is_broken_is_said_to_be(
    tmp_path: Path, variable: dict[str, str], said: str
) -> None:
    (tmp_path / "numba.py").write_text("raise ImportError('needs another numpy')")
    environment = {**os.environ, **{name: value.format(tmp_path) for name, value in variable.items()}}
    program = "from emulator.kernel import jit; print(jit.COMPILED)"
    ended = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False
    )
    assert said in (ended.stderr.splitlines() or [ended.stdout])[-1]

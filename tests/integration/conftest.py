"""The wheels of fanet-mw and of the example package, installed once for all test processes, without a network."""

import fcntl
from pathlib import Path

import pytest
from installed import Installed, install


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Installed:
    base = tmp_path_factory.getbasetemp()
    folder: Path = (base if worker_id == "master" else base.parent) / "installed"  # the parent is that of all workers
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if (folder / "done").exists():
            return Installed(folder / "environment")
        made = install(folder)
        (folder / "done").touch()
        return made

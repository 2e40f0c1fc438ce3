"""Carries out runs on an existing Dask cluster: any number of machines, each with this version of fanet-mw.

If a worker dies, the scheduler gives its runs to others. A run that kills several workers has failed.
"""

from collections.abc import Iterator, Sequence
from typing import Final

from distributed import Client, KilledWorker, as_completed

from fanet_mw.errors import ConfigError, HostError
from sim.sweep.one_run import Finished, carry_out
from sim.sweep.provenance import code
from sim.sweep.tasks import Task

_WORKERS_S: Final = 30
"""The time in which the first worker must be there."""


class DaskCluster:
    """The workers of one scheduler."""

    def __init__(self, address: str) -> None:
        self._address = address
        try:
            self._client = Client(address, timeout="10s", set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise HostError(f"--scheduler {address}: no Dask scheduler answers: {error}") from error
        try:
            self.workers = self._checked()
        except BaseException:
            self._client.close()
            raise

    def _checked(self) -> int:
        """The number of workers; raises ConfigError if their code differs, because then rows might."""
        try:
            self._client.wait_for_workers(1, timeout=_WORKERS_S)
        except TimeoutError as error:
            raise HostError(
                f"--scheduler {self._address}: no worker within {_WORKERS_S} s; start some: "
                f"dask worker {self._address} --nthreads 1"
            ) from error
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        for name, worker in workers.items():
            if worker["nthreads"] != 1:
                raise ConfigError(
                    f"worker {name} has {worker['nthreads']} threads: must be 1 (dask worker --nthreads 1); "
                    "runs in one process would wait for each other"
                )
        for name, theirs in self._client.run(code).items():
            if theirs != code():
                raise ConfigError(f"worker {name} has fanet-mw {theirs}, and here is {code()}: must be the same")
        return len(workers)

    def carry_out(self, tasks: Sequence[Task]) -> Iterator[Finished]:
        """The result of each task, in the order in which they end."""
        try:
            futures = {self._client.submit(carry_out, task, pure=False): task for task in tasks}
            for future in as_completed(list(futures), loop=self._client.loop):
                try:
                    yield future.result()
                except KilledWorker as error:
                    yield Finished(futures[future].key, code(), 0.0, error=f"it killed its workers: {error}")
                future.release()
        except (OSError, TimeoutError) as error:
            raise HostError(
                f"--scheduler {self._address}: connection lost: {error}; what is finished is kept"
            ) from error
        finally:
            self.close()

    def close(self) -> None:
        self._client.close()

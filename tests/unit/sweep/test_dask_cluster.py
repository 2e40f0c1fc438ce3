"""A Dask cluster that cannot be used."""

import pytest

from fanet_mw.errors import HostError

distributed = pytest.importorskip("distributed")


@pytest.mark.slow
def test_a_scheduler_without_workers_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    from sim.sweep import dask_cluster

    monkeypatch.setattr(dask_cluster, "_WORKERS_S", 1)
    with distributed.LocalCluster(n_workers=0, dashboard_address=None, processes=False) as cluster:
        address = cluster.scheduler_address
        with pytest.raises(HostError, match=f"--scheduler {address}: no worker within 1 s; start some: dask worker"):
            dask_cluster.DaskCluster(address)

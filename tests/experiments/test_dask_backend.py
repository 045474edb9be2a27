"""Repetitions on a local Dask cluster of two workers, the pattern for a real one."""

from functools import partial

import pytest

from experiments.minimum_example import MinimumExampleConfig, fit_sets
from experiments.repetitions import Execution, run_repetitions
from serd_core.errors import SerdError

distributed = pytest.importorskip("distributed", reason="pip install distributed to test Dask")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of a cluster starting and stopping, none of them ours
def test_a_dask_cluster_gives_the_same_rows_as_this_process(tmp_path):
    work = partial(fit_sets, MinimumExampleConfig(n_sets=6, sizes=(3,)), 2)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
        ) as cluster,
        distributed.Client(cluster),
    ):
        remote = run_repetitions(
            work, 3, tmp_path / "dask", "sets", Execution(backend="dask"), lambda *_: None
        )
    local = run_repetitions(
        work, 3, tmp_path / "here", "sets", Execution(n_jobs=1), lambda *_: None
    )
    assert remote == local


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of a cluster starting and stopping, none of them ours
def test_the_cluster_that_the_environment_names_is_used(tmp_path, monkeypatch):
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", cluster.scheduler_address)
        work = partial(fit_sets, MinimumExampleConfig(n_sets=2, sizes=(3,)), 2)
        rows = run_repetitions(
            work, 1, tmp_path, "sets", Execution(backend="dask"), lambda *_: None
        )
        client = distributed.get_client()
        assert client.scheduler.address == cluster.scheduler_address
        client.close()
    assert len(rows) == 4


def test_an_address_without_a_scheduler_is_named(monkeypatch):
    monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", "nonsense://nowhere")
    with pytest.raises(SerdError, match="must be that of a running scheduler, got nonsense"):
        Execution(backend="dask").activate()

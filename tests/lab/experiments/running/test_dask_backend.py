"""Repetitions on a running Dask cluster of two workers, the pattern for a real one."""

from functools import partial

import pytest

from lab.experiments.minimum_example.explanations import MinimumExampleConfig, fit_sets
from lab.experiments.running.repetitions import run_repetitions
from serd_sim.episodes.execution import Execution

distributed = pytest.importorskip("distributed", reason="pip install distributed to test Dask")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of a cluster starting and stopping, none of them ours
def test_a_dask_cluster_gives_the_same_rows_as_this_process(tmp_path):
    work = partial(fit_sets, MinimumExampleConfig(n_sets=6, sizes=(3,)), 2)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        there = Execution(2, "dask", cluster.scheduler_address)
        remote = run_repetitions(work, 3, tmp_path / "dask", "sets", there, lambda *_: None)
    here = run_repetitions(work, 3, tmp_path / "here", "sets", Execution(1), lambda *_: None)
    assert remote == here

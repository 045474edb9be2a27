"""Repetitions on a local Ray cluster of two workers, the pattern for a real one."""

from functools import partial

import pytest

from experiments.minimum_example import MinimumExampleConfig, fit_sets
from experiments.repetitions import Execution, run_repetitions

ray = pytest.importorskip("ray", reason="pip install ray to test its backend")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of a cluster starting and stopping, none of them ours
def test_a_ray_cluster_gives_the_same_rows_as_this_process(tmp_path):
    from ray.util.joblib import register_ray

    work = partial(fit_sets, MinimumExampleConfig(n_sets=6, sizes=(3,)), 2)
    ray.init(num_cpus=2, include_dashboard=False, _node_ip_address="127.0.0.1")
    try:
        register_ray()
        execution = Execution(n_jobs=2, backend="ray")
        remote = run_repetitions(work, 3, tmp_path / "ray", "sets", execution, lambda *_: None)
    finally:
        ray.shutdown()
    local = run_repetitions(
        work, 3, tmp_path / "here", "sets", Execution(n_jobs=1), lambda *_: None
    )
    assert remote == local

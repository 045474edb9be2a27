"""Rewards and dynamics from demonstrations in Markov decision processes.

    import serd_core as sc

`__init__.pyi` lists the names of this flat interface. Each is imported from its module at first
use, as imports of single modules are to stay fast.
"""

import ast
import functools
import importlib
from pathlib import Path
from typing import Any

__version__ = "0.4.0"

#: Names of version 0.3.0 that left; CHANGELOG.md has what to use. Version 0.5.0 forgets them.
_LEFT = """
Automatic BandedLu BeliefAroundTruth CovariateModels DwellTimes EntropyPrior GradientAscent Krylov
Newton NormPrior SparseLu SparseModel ValueIteration adjusted_rand_index arrival_time_distribution
choose_expert_types compare_beliefs confidence_interval counted_transitions counterfactual_policy
credible_intervals decisions_from_columns dynamics_divergence dynamics_draws fit_dwell_times
fit_expert_types fit_routes learned_transitions load mean_discounted_outcomes multi_start
posterior_modes renewal_chain sample_posterior save score_test semi_markov_arrival
two_step_standard_errors vuong_test with_choice_cost
"""


@functools.cache
def _homes() -> dict[str, str]:
    """Module of each name of the interface."""
    stub = ast.parse(Path(__file__).with_name("__init__.pyi").read_text(encoding="utf-8"))
    imports = (node for node in stub.body if isinstance(node, ast.ImportFrom))
    return {name.name: str(node.module) for node in imports for name in node.names}


def __getattr__(name: str) -> Any:
    home = None if name.startswith("_") else _homes().get(name)
    if home is None:
        went = "; it left after version 0.3.0 (CHANGELOG.md)" if name in _LEFT.split() else ""
        raise AttributeError(f"module 'serd_core' has no attribute {name!r}{went}")
    found = getattr(importlib.import_module(home), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({"__version__", *_homes()})

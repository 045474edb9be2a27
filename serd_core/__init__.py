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

__version__ = "0.3.0"

#: Names of version 0.2.0 that left, and what to use; version 0.4.0 forgets them.
_LEFT = {
    **dict.fromkeys(
        ("DwellTimes", "arrival_time_distribution", "renewal_chain", "semi_markov_arrival"),
        "use timed_arrival, which takes problems without dwell times too",
    ),
    **dict.fromkeys(
        (
            "EntropyPrior",
            "GradientAscent",
            "NormPrior",
            "dynamics_divergence",
            "fit_routes",
            "multi_start",
            "posterior_modes",
            "sample_posterior",
        ),
        "the authors' lab has it",
    ),
    **dict.fromkeys(
        ("Automatic", "BandedLu", "Krylov", "Newton", "SparseLu", "ValueIteration"),
        "policies and fits choose their solver",
    ),
    "decisions_from_columns": "use Decisions(*(table[name] for name in columns))",
    "BeliefAroundTruth": "use CoupledBelief, or FreeBelief with a prior on each block",
    "CovariateModels": "use OutcomeModels with a local model per class of pairs",
    "SparseModel": "use fixed_transitions or learned_transitions",
    "adjusted_rand_index": "use sklearn.metrics.adjusted_rand_score",
    "bootstrap": "fit anew to decisions.select_episodes of drawn episodes",
    "compare_beliefs": "compare laplace(...).log_evidence of fits under either belief",
    "confidence_interval": "use StandardErrors.reward_interval",
    "counted_transitions": "use from_transitions of the counts",
    "counterfactual_policy": "use soft_policy(problem, weights, belief)",
    "credible_intervals": "use numpy.quantile of the draws",
    "dynamics_draws": "use laplace_draws(found, rng, n).truth",
    "fit_dwell_times": "use fit_mdce_serd of semi_markov_problem(problem)",
    **dict.fromkeys(
        ("finite_horizon", "decisions_in_periods"), "number the states of each period apart"
    ),
    "from_gymnasium": "use from_transitions (docs/library.md)",
    "load": "unpickle what you pickled",
    "mean_discounted_outcomes": "use transitions.local_probabilities(draws).mean(axis=0)",
    "save": "pickle the record",
    "with_choice_cost": "append the feature -log |A(s)| to those of the problem",
}


@functools.cache
def _homes() -> dict[str, str]:
    """Module of each name of the interface."""
    stub = ast.parse(Path(__file__).with_name("__init__.pyi").read_text(encoding="utf-8"))
    imports = (node for node in stub.body if isinstance(node, ast.ImportFrom))
    return {name.name: str(node.module) for node in imports for name in node.names}


def __getattr__(name: str) -> Any:
    home = None if name.startswith("_") else _homes().get(name)
    if home is None:
        went = f"; {_LEFT[name]}" if name in _LEFT else ""
        raise AttributeError(f"module 'serd_core' has no attribute {name!r}{went}")
    found = getattr(importlib.import_module(home), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({"__version__", *_homes()})

"""All experiments of the thesis, in the order of its chapters."""

from collections.abc import Callable
from typing import Any, get_type_hints

from experiments.gridworld.ascents import run_ascents
from experiments.gridworld.early_stopping import run_early_stopping
from experiments.gridworld.experiment import run_gridworld
from experiments.information.avoidance import run_avoidance
from experiments.information.next_demonstration import run_next_demonstration
from experiments.latent.hidden_actions import run_hidden_actions
from experiments.minimum_example.explanations import run_minimum_example
from experiments.minimum_example.multi_start import run_multi_start
from experiments.policy_cost import run_policy_cost
from experiments.priors import run_priors
from experiments.routes import run_routes
from experiments.running.experiment import Experiment, Findings, Session
from experiments.rust import run_rust

#: What each shows; `run_multi_start` is the experiment "multi-start".
_SUBJECTS: dict[Callable[[Any, Session], Findings], str] = {
    run_minimum_example: "two explanations of one behaviour (section 4.6.1)",
    run_multi_start: "distinct explanations found by random starts (section 4.1)",
    run_priors: "what each prior prefers (section 4.5.4)",
    run_policy_cost: "what a gradient costs (Table 4.2)",
    run_gridworld: "navigation on satellite images (section 4.6.2)",
    run_early_stopping: "fits stopped by validation demonstrations (section 5.2)",
    run_ascents: "gradient ascent of Algorithm 1 and faster optimisers (section 4.4)",
    run_avoidance: "what choices reveal of a move that is avoided",
    run_hidden_actions: "rewards and dynamics from states alone",
    run_next_demonstration: "what choosing the next demonstration saves",
    run_routes: "route choice with many destinations (recursive logit)",
    run_rust: "bus engine replacement (Rust 1987)",
}
EXPERIMENTS = tuple(
    Experiment(
        name=run.__name__.removeprefix("run_").replace("_", "-"),
        shows=shows,
        config=get_type_hints(run)["config"],
        run=run,
    )
    for run, shows in _SUBJECTS.items()
)

"""All experiments of the thesis, in the order of its chapters."""

from experiments.gridworld.ascents import AscentsConfig, run_ascents
from experiments.gridworld.early_stopping import EarlyStoppingConfig, run_early_stopping
from experiments.gridworld.experiment import GridworldConfig, run_gridworld
from experiments.information.avoidance import AvoidanceConfig, run_avoidance
from experiments.information.next_demonstration import (
    NextDemonstrationConfig,
    run_next_demonstration,
)
from experiments.latent.hidden_actions import HiddenActionsConfig, run_hidden_actions
from experiments.latent.mixed_experts import MixedExpertsConfig, run_mixed_experts
from experiments.minimum_example.explanations import MinimumExampleConfig, run_minimum_example
from experiments.minimum_example.multi_start import MultiStartConfig, run_multi_start
from experiments.policy_cost import PolicyCostConfig, run_policy_cost
from experiments.priors import PriorsConfig, run_priors
from experiments.routes import RoutesConfig, run_routes
from experiments.running.experiment import Experiment
from experiments.rust import RustConfig, run_rust

EXPERIMENTS = (
    Experiment(
        "minimum-example",
        "two explanations of one behaviour (section 4.6.1)",
        MinimumExampleConfig,
        run_minimum_example,
    ),
    Experiment(
        "multi-start",
        "distinct explanations found by random starts (section 4.1)",
        MultiStartConfig,
        run_multi_start,
    ),
    Experiment("priors", "what each prior prefers (section 4.5.4)", PriorsConfig, run_priors),
    Experiment(
        "policy-cost", "what a gradient costs (Table 4.2)", PolicyCostConfig, run_policy_cost
    ),
    Experiment(
        "gridworld",
        "navigation on satellite images (section 4.6.2)",
        GridworldConfig,
        run_gridworld,
    ),
    Experiment(
        "early-stopping",
        "fits stopped by validation demonstrations (section 5.2)",
        EarlyStoppingConfig,
        run_early_stopping,
    ),
    Experiment(
        "ascents",
        "gradient ascent of Algorithm 1 and faster optimisers (section 4.4)",
        AscentsConfig,
        run_ascents,
    ),
    Experiment(
        "avoidance", "what choices reveal of a move that is avoided", AvoidanceConfig, run_avoidance
    ),
    Experiment(
        "hidden-actions",
        "rewards and dynamics from states alone",
        HiddenActionsConfig,
        run_hidden_actions,
    ),
    Experiment(
        "mixed-experts",
        "types of experts found among mixed demonstrations",
        MixedExpertsConfig,
        run_mixed_experts,
    ),
    Experiment(
        "next-demonstration",
        "what choosing the next demonstration saves",
        NextDemonstrationConfig,
        run_next_demonstration,
    ),
    Experiment(
        "routes", "route choice with many destinations (recursive logit)", RoutesConfig, run_routes
    ),
    Experiment("rust", "bus engine replacement (Rust 1987)", RustConfig, run_rust),
)

"""Names of the flat interface; docs/library.md describes them."""

from serd_core import plots as plots
from serd_core.arrival.chain import timed_arrival as timed_arrival
from serd_core.arrival.law import crps_s as crps_s
from serd_core.arrival.law import detectable_delay as detectable_delay
from serd_core.arrival.law import gap_probability as gap_probability
from serd_core.ascent.ascent import Lbfgs as Lbfgs
from serd_core.ascent.kinked import KinkedAscent as KinkedAscent
from serd_core.ascent.trust_region import NewtonAscent as NewtonAscent
from serd_core.ascent.trust_region import TrustRegion as TrustRegion
from serd_core.bayes.information import expected_information_gain as expected_information_gain
from serd_core.bayes.information import outcome_information as outcome_information
from serd_core.bayes.laplace import interval_draws as interval_draws
from serd_core.bayes.laplace import laplace as laplace
from serd_core.bayes.laplace import laplace_draws as laplace_draws
from serd_core.bayes.laplace import posterior_policy as posterior_policy
from serd_core.bayes.strengths import PriorByEvidence as PriorByEvidence
from serd_core.demonstrations.decisions import HIDDEN as HIDDEN
from serd_core.demonstrations.decisions import Decisions as Decisions
from serd_core.demonstrations.decisions import TimedDecisions as TimedDecisions
from serd_core.demonstrations.decisions import decisions_from_episodes as decisions_from_episodes
from serd_core.demonstrations.simulation import sample_decisions as sample_decisions
from serd_core.demonstrations.simulation import sample_timed_decisions as sample_timed_decisions
from serd_core.dynamics.estimation import estimate_dynamics as estimate_dynamics
from serd_core.dynamics.outcome_models import OutcomeModels as OutcomeModels
from serd_core.dynamics.outcome_models import fixed_transitions as fixed_transitions
from serd_core.errors import SerdError as SerdError
from serd_core.learners.fit_result import FitResult as FitResult
from serd_core.learners.maxent_irl import fit_maxent_irl as fit_maxent_irl
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy as fit_mdce_irl_by_entropy
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood as fit_mdce_irl_by_likelihood
from serd_core.learners.policy_matching import clone_behaviour as clone_behaviour
from serd_core.learners.policy_matching import fit_policy_matching as fit_policy_matching
from serd_core.learners.relative_entropy_irl import (
    fit_relative_entropy_irl as fit_relative_entropy_irl,
)
from serd_core.learners.relative_entropy_irl import hoeffding_thresholds as hoeffding_thresholds
from serd_core.learners.serd import fit_mdce_serd as fit_mdce_serd
from serd_core.learners.serd import fit_pm_serd as fit_pm_serd
from serd_core.learners.several_goals import fit_several_goals as fit_several_goals
from serd_core.mdp.finite_horizon import decisions_in_periods as decisions_in_periods
from serd_core.mdp.finite_horizon import finite_horizon as finite_horizon
from serd_core.mdp.mdp import Mdp as Mdp
from serd_core.mdp.problem import TabularProblem as TabularProblem
from serd_core.mdp.problem import from_gymnasium as from_gymnasium
from serd_core.mdp.problem import from_transitions as from_transitions
from serd_core.policies.pessimistic_policy import pessimistic_policy as pessimistic_policy
from serd_core.policies.solved_policy import boltzmann_policy as boltzmann_policy
from serd_core.policies.solved_policy import optimal_policy as optimal_policy
from serd_core.policies.solved_policy import soft_policy as soft_policy
from serd_core.posterior.beliefs import CoupledBelief as CoupledBelief
from serd_core.posterior.beliefs import FixedBelief as FixedBelief
from serd_core.posterior.beliefs import FreeBelief as FreeBelief
from serd_core.posterior.beliefs import TiedBelief as TiedBelief
from serd_core.posterior.parameters import Block as Block
from serd_core.priors.divergence import DirichletPrior as DirichletPrior
from serd_core.priors.divergence import KldPrior as KldPrior
from serd_core.priors.prior import GaussianPrior as GaussianPrior
from serd_core.priors.prior import UniformPrior as UniformPrior
from serd_core.selection.evaluation import fitted_policy as fitted_policy
from serd_core.selection.evaluation import move_log_likelihood as move_log_likelihood
from serd_core.selection.evaluation import policy_log_likelihood as policy_log_likelihood
from serd_core.selection.evaluation import validation_log_likelihood as validation_log_likelihood
from serd_core.selection.joint_dynamics import fit_under_counts as fit_under_counts
from serd_core.selection.joint_dynamics import judge_joint_dynamics as judge_joint_dynamics
from serd_core.semi_markov.dwell_likelihood import DwellPrior as DwellPrior
from serd_core.semi_markov.models import semi_markov_problem as semi_markov_problem
from serd_core.semi_markov.place import compare_places as compare_places
from serd_core.semi_markov.place import dwell_summary as dwell_summary
from serd_core.semi_markov.place import fit_places as fit_places
from serd_core.uncertainty.inference import bootstrap as bootstrap
from serd_core.uncertainty.inference import clustered_outer_product as clustered_outer_product
from serd_core.uncertainty.inference import likelihood_ratio_test as likelihood_ratio_test
from serd_core.uncertainty.standard_errors import fit_information as fit_information
from serd_core.uncertainty.standard_errors import identifiability as identifiability
from serd_core.uncertainty.standard_errors import standard_errors as standard_errors

__version__: str
__all__: list[str]

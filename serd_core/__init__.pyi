"""Names of the flat interface, `import serd_core as sc`; docs/library.md describes them."""

from serd_core.arrival.chain import arrival_time_distribution as arrival_time_distribution
from serd_core.ascent.gradient_ascent import GradientAscent as GradientAscent
from serd_core.ascent.kinked import KinkedAscent as KinkedAscent
from serd_core.ascent.lbfgs import Lbfgs as Lbfgs
from serd_core.ascent.newton_ascent import NewtonAscent as NewtonAscent
from serd_core.ascent.trust_region import TrustRegion as TrustRegion
from serd_core.bayes.belief_comparison import compare_beliefs as compare_beliefs
from serd_core.bayes.design import expected_information_gain as expected_information_gain
from serd_core.bayes.draws import credible_intervals as credible_intervals
from serd_core.bayes.draws import laplace_draws as laplace_draws
from serd_core.bayes.draws import posterior_policy as posterior_policy
from serd_core.bayes.information import outcome_information as outcome_information
from serd_core.bayes.laplace import laplace as laplace
from serd_core.bayes.modes import posterior_modes as posterior_modes
from serd_core.bayes.sampler import sample_posterior as sample_posterior
from serd_core.bayes.strengths import PriorByEvidence as PriorByEvidence
from serd_core.bellman.linear.automatic import Automatic as Automatic
from serd_core.bellman.linear.banded_lu import BandedLu as BandedLu
from serd_core.bellman.linear.krylov import Krylov as Krylov
from serd_core.bellman.linear.sparse_lu import SparseLu as SparseLu
from serd_core.bellman.newton import Newton as Newton
from serd_core.bellman.value_iteration import ValueIteration as ValueIteration
from serd_core.demonstrations.decisions import HIDDEN as HIDDEN
from serd_core.demonstrations.decisions import Decisions as Decisions
from serd_core.demonstrations.simulation import sample_decisions as sample_decisions
from serd_core.demonstrations.tables import decisions_from_columns as decisions_from_columns
from serd_core.demonstrations.tables import decisions_from_episodes as decisions_from_episodes
from serd_core.dynamics.estimation import estimate_dynamics as estimate_dynamics
from serd_core.dynamics.outcome_models import OutcomeModels as OutcomeModels
from serd_core.dynamics.sparse_model import SparseModel as SparseModel
from serd_core.dynamics.sparse_model import fixed_transitions as fixed_transitions
from serd_core.errors import SerdError as SerdError
from serd_core.files import load as load
from serd_core.files import save as save
from serd_core.learners.behavioural_cloning import clone_behaviour as clone_behaviour
from serd_core.learners.fit_result import FitResult as FitResult
from serd_core.learners.maxent_irl import fit_maxent_irl as fit_maxent_irl
from serd_core.learners.mdce_irl import fit_mdce_irl_by_entropy as fit_mdce_irl_by_entropy
from serd_core.learners.mdce_irl import fit_mdce_irl_by_likelihood as fit_mdce_irl_by_likelihood
from serd_core.learners.policy_matching import fit_policy_matching as fit_policy_matching
from serd_core.learners.relative_entropy_irl import (
    fit_relative_entropy_irl as fit_relative_entropy_irl,
)
from serd_core.learners.serd import fit_mdce_serd as fit_mdce_serd
from serd_core.learners.serd import fit_pm_serd as fit_pm_serd
from serd_core.mdp.mdp import Mdp as Mdp
from serd_core.mdp.problem import TabularProblem as TabularProblem
from serd_core.mdp.tables import from_gymnasium as from_gymnasium
from serd_core.mdp.tables import from_transitions as from_transitions
from serd_core.policies.solved_policy import boltzmann_policy as boltzmann_policy
from serd_core.policies.solved_policy import optimal_policy as optimal_policy
from serd_core.policies.solved_policy import soft_policy as soft_policy
from serd_core.posterior.beliefs import BeliefAroundTruth as BeliefAroundTruth
from serd_core.posterior.beliefs import CoupledBelief as CoupledBelief
from serd_core.posterior.beliefs import FixedBelief as FixedBelief
from serd_core.posterior.beliefs import FreeBelief as FreeBelief
from serd_core.posterior.beliefs import TiedBelief as TiedBelief
from serd_core.posterior.parameters import Block as Block
from serd_core.priors.dirichlet import DirichletPrior as DirichletPrior
from serd_core.priors.divergence import KldPrior as KldPrior
from serd_core.priors.entropy import EntropyPrior as EntropyPrior
from serd_core.priors.gaussian import GaussianPrior as GaussianPrior
from serd_core.priors.norm import NormPrior as NormPrior
from serd_core.priors.prior import UniformPrior as UniformPrior
from serd_core.selection.evaluation import dynamics_divergence as dynamics_divergence
from serd_core.selection.evaluation import fitted_policy as fitted_policy
from serd_core.selection.evaluation import move_log_likelihood as move_log_likelihood
from serd_core.selection.evaluation import policy_log_likelihood as policy_log_likelihood
from serd_core.selection.evaluation import validation_log_likelihood as validation_log_likelihood
from serd_core.selection.multi_start import multi_start as multi_start
from serd_core.uncertainty.identifiability import identifiability as identifiability
from serd_core.uncertainty.information import fit_information as fit_information
from serd_core.uncertainty.standard_errors import confidence_interval as confidence_interval
from serd_core.uncertainty.standard_errors import standard_errors as standard_errors

__version__: str

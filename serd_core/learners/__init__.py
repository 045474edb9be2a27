"""Estimators of rewards, and of dynamics with them, from demonstrations.

Every learner of rewards is called alike and returns a `FitResult`:

    fit(problem, decisions, *, initial_weights=None, rng=None, dynamics=None, ..., on_step=None)

`initial_weights` (F,) is where the search starts; without it a start is drawn from `rng`, except
by `fit_mdce_serd` without a prior, whose default is chosen by evidence and starts without chance.
`dynamics` are (M, K) outcome probabilities (for a SparseModel its parameters) and the M-estimate
where not given: SERD learns on from them, the others take them as known. `on_step` is called with
a `Step` after each step and stops the fit by returning True. All but relative entropy IRL, which
needs bounds, take an `ascent`.

- `fit_mdce_serd`, `fit_pm_serd`: rewards and dynamics, for experts with the causal entropy policy
  and the policy-matching policy; both also take `belief` and `prior`. `fit_serd` is their common
  algorithm.
- `fit_mdce_irl_by_likelihood` (takes `prior`), `fit_mdce_irl_by_entropy` (`slack`),
  `fit_maxent_irl`, `fit_policy_matching` (`inverse_temperature`, `objective`) and
  `fit_relative_entropy_irl` (`samples` and the `sampling_policy` that made them): rewards alone.
- `clone_behaviour(problem, decisions, pseudo_count)` learns no rewards and returns its policy.
"""

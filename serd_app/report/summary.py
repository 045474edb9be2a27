"""The numbers of a report: for summary.json, the headline and the terminal."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from serd_app.navigation.comparison import (
    agreement,
    reasons_against_prediction,
    reasons_text,
    starts_of,
)
from serd_app.navigation.navigator import plan_remarks
from serd_app.report.charts import measured_curve, time_reaching
from serd_app.report.inputs import ReportInputs, percent
from serd_bag.quantities import counted, seconds_in_words
from serd_core.arrays import IntArray
from serd_core.demonstrations.decisions import Decisions
from serd_core.grid.navigation import NavigationProblem

#: Plain values by name, which `summary_of` describes.
Summary = dict[str, Any]


def summary_of(inputs: ReportInputs) -> Summary:
    """Everything the report states as a number; a median is None when fewer than half arrived.

    Without episodes all that is measured is None, and so is the agreement. n_decisions: learned
    from, as are decisions_per_model; of a model without a posterior these are of
    n_compared_decisions, those of the demonstrations that it is compared with. n_least_time_states:
    states in which the policy takes the way of least expected time, as the learned one does not
    arrive; n_trap_states: those from which no policy does. recorded_times_s: of arrival of the
    demonstrations, None where they are not known. no_prediction_because: why the predicted arrival
    is not stated, none where it is. checks: of the model, see
    `serd_app.learning.criticism`.
    """
    fit, n_given, recorded = inputs.fit, inputs.n_demonstrations, inputs.recorded
    run, strategy = inputs.run, inputs.strategy
    n_demonstrations = n_given or len(inputs.demonstrations.episodes)
    return {
        "n_demonstrations": n_demonstrations,
        "n_decisions": fit.n_decisions if n_given else len(inputs.demonstrations),
        "n_compared_decisions": len(inputs.demonstrations),
        **_of_arrival(inputs),
        "n_trap_states": len(strategy.traps.states),
        "n_least_time_states": int(strategy.by_time.sum()),
        "plan_remarks": tuple(plan_remarks(strategy)),
        "recorded_times_s": None if recorded is None else tuple(recorded.times_s.tolist()),
        "no_prediction_because": reasons_against_prediction(
            n_demonstrations=n_demonstrations,
            starts=starts_of(strategy, "train"),
            checks=strategy.file.checks,
            recorded=recorded,
            measured=(inputs.predicted, inputs.arrival_times_s) if inputs.episodes else None,
        ),
        "checks": [each.model_dump() for each in strategy.file.checks],
        **_of_fit(inputs),
        "wall_s": {phase.name: phase.wall_s for phase in run.phases},
        "seeds": dict(run.seeds),
        "versions": dict(run.versions),
        "command": run.command,
        "how": run.how,
        "finished_at": run.finished_at,
    }


def _of_arrival(inputs: ReportInputs) -> dict[str, Any]:
    """Of the episodes, beside what is predicted."""
    episodes, timeout_s = inputs.episodes, inputs.strategy.timeout_s
    measured = measured_curve(inputs.arrival_times_s, timeout_s) if episodes else None
    times = [row.time_of_arrival_s for row in episodes if row.arrived]
    return {
        "n_episodes": len(episodes),
        "n_arrived": len(times),
        "measured_arrival_probability": len(times) / len(episodes) if episodes else None,
        "measured_arrival_interval_95": None
        if measured is None
        else (float(measured.lower[-1]), float(measured.upper[-1])),
        "predicted_arrival_probability": float(inputs.predicted.cdf[-1]),
        "measured_median_s": None if measured is None else time_reaching(measured, 0.5),
        "predicted_median_s": inputs.predicted.quantile_s(0.5),
        "measured_mean_s": float(np.mean(times)) if times else None,
        "agreement": asdict(agreement(inputs.predicted, inputs.arrival_times_s))
        if episodes
        else None,
        "timeout_s": timeout_s,
        "robot_on_person_contacts": sum(row.robot_on_person for row in episodes),
        "person_on_robot_contacts": sum(row.person_on_robot for row in episodes),
        "wall_contacts": sum(row.robot_on_wall for row in episodes),
    }


def _of_fit(inputs: ReportInputs) -> dict[str, Any]:
    """Of rewards and outcomes."""
    fit, models = inputs.fit, inputs.strategy.problem.model_names
    file = inputs.strategy.file
    initial = fit.initial_outcome_probabilities.tolist()
    return {
        "converged": bool(fit.converged),
        "n_steps": int(fit.n_steps),
        "objective": float(fit.objective),
        "reward_weights": dict(zip(fit.feature_names, fit.reward_weights.tolist(), strict=True)),
        "features_left_out": {each.name: each.left_out for each in file.features if each.left_out},
        "decisions_per_model": dict(zip(models, known_decisions(inputs).tolist(), strict=True)),
        "outcome_probabilities": dict(zip(models, fit.outcome_probabilities.tolist(), strict=True)),
        "initial_outcome_probabilities": dict(zip(models, initial, strict=True)),
    }


def headline_of(summary: Summary) -> str:
    """From how many demonstrations, how many arrivals, how fast, and what had been predicted.

    Where the prediction is not supported it is left out, and the sentence says why; where a check
    of the model fails, that is the sentence.
    """
    after = f"After {counted(summary['n_demonstrations'], 'demonstration')}"
    within = f"within {seconds_in_words(summary['timeout_s'])}"
    reasons = reasons_text(summary["no_prediction_because"])
    predicted, half_s = percent(summary["predicted_arrival_probability"]), None
    if not reasons:
        half_s = summary["predicted_median_s"]
    if summary["measured_arrival_probability"] is not None:
        beside = f"no prediction, because {reasons}" if reasons else f"predicted {predicted}"
        return (
            f"{after} the robot reached the goal in {summary['n_arrived']} of"
            f" {counted(summary['n_episodes'], 'new episode')} {within}"
            f" ({percent(summary['measured_arrival_probability'])}; {beside})"
            f"{_speed(summary['measured_median_s'], half_s)}."
        )
    after += f" with {counted(summary['n_decisions'], 'decision')}"
    failure = next((each["sentence"] for each in summary["checks"] if each["mark"] == "fails"), "")
    if failure:
        return f"{failure[0].upper()}{failure[1:]}."
    if reasons:
        arrived = _recorded(summary)
        return f"{after}{arrived} the arrival of the robot is not predicted, because {reasons}."
    half = "" if half_s is None else f", half of the drives within {seconds_in_words(half_s)}"
    return f"{after} the robot is predicted to reach the goal {within} with {predicted}{half}."


def _speed(measured_s: float | None, predicted_s: float | None) -> str:
    if measured_s is None:
        return ", fewer than half of them in time"
    measured = f", half of them within {seconds_in_words(measured_s)}"
    return measured + (
        "" if predicted_s is None else f" (predicted {seconds_in_words(predicted_s)})"
    )


def _recorded(summary: Summary) -> str:
    times_s = summary["recorded_times_s"]
    if not times_s:
        return ""
    all_of_them = len(times_s) == summary["n_demonstrations"]
    who = "which" if all_of_them else f"of which {len(times_s)}"
    return f", {who} arrived after {span_in_words(times_s)},"


def span_in_words(times_s: Sequence[float]) -> str:
    """From the first to the last, which may be the same."""
    return " to ".join(dict.fromkeys(map(seconds_in_words, (min(times_s), max(times_s)))))


def known_decisions(inputs: ReportInputs) -> IntArray:
    """(M,) decisions per outcome model; see `Summary`."""
    if not inputs.n_demonstrations or inputs.knowledge is None:
        return decisions_per_model(inputs.strategy.problem, inputs.demonstrations)
    known = inputs.knowledge.by_model
    counts = [round(known[name][0].decisions) for name in inputs.strategy.problem.model_names]
    return np.array(counts, dtype=np.int64)


def decisions_per_model(problem: NavigationProblem, decisions: Decisions) -> IntArray:
    """(M,) number of decisions with their action that each outcome model applies to."""
    models = problem.outcome_models
    decisions = decisions.select(~decisions.hidden)
    used = models.model_of[decisions.state, decisions.action]
    return np.bincount(used, minlength=models.n_models)

"""A lesson for people (a log line) and for programs (values on `diagnostics`)."""

from serd_app.learning.recipe import Lesson


def lesson_in_words(lesson: Lesson) -> str:
    """How the fit ended and what it found, in one line."""
    fit = lesson.fit
    pairs = zip(fit.feature_names, fit.reward_weights, strict=True)
    weights = ", ".join(f"{name} {weight:+.2f}" for name, weight in pairs)
    spread = max(lesson.objectives) - min(lesson.objectives)
    starts = f", starts differ by {spread:.2g}" if len(lesson.objectives) > 1 else ""
    return (
        f"{'converged' if fit.converged else 'NOT converged'} ({fit.message}); log posterior "
        f"{fit.objective:.2f}{starts}; weights: {weights}"
    )


def lesson_values(lesson: Lesson) -> dict[str, object]:
    """The summary of the fit by name."""
    fit = lesson.fit
    return {
        "converged": fit.converged,
        "objective": fit.objective,
        "gradient_norm": fit.gradient_norm,
        "n_episodes": lesson.model.fit.n_episodes,
        "n_decisions": fit.n_decisions,
        "n_steps": fit.n_steps,
        **{f"weight.{name}": weight for name, weight in lesson.model.reward_weights.items()},
    }

"""What learning returns: the fit, its model file and how the fit went."""

from dataclasses import dataclass
from pathlib import Path

from serd_app.demonstrations.grid_file import save_grid
from serd_app.learning.knowledge import Knowledge, save_knowledge
from serd_core.grid.grid import Grid
from serd_core.learners.fit_result import FitResult
from storage.files import atomic_write_text
from storage.model_file import ModelFile, save_model


@dataclass(frozen=True, eq=False)
class FitOutcome:
    """A fit and the model file that keeps it.

    prior_weight: the weight it used, None for methods without; validation: log-likelihood per
    validation decision of each candidate weight, empty where none was chosen. knowledge: None where
    the fit has no posterior.
    """

    fit: FitResult
    model: ModelFile
    prior_weight: float | None
    validation: tuple[tuple[float, float], ...]
    knowledge: Knowledge | None = None

    def trace_table(self) -> str:
        """The objective after each step of the fit to all episodes, as CSV."""
        rows = enumerate(self.fit.objective_trace.tolist(), start=1)
        return "step,objective\n" + "".join(f"{step},{value!r}\n" for step, value in rows)

    def summary(self) -> str:
        """How the fit ended and what it found, in one line."""
        fit = self.fit
        pairs = zip(fit.feature_names, fit.reward_weights, strict=True)
        weights = ", ".join(f"{name} {weight:+.2f}" for name, weight in pairs)
        prior = "" if self.prior_weight is None else f", prior weight {self.prior_weight:g}"
        return (
            f"{self.model.method} {'converged' if fit.converged else 'did NOT converge'}"
            f" ({fit.message}){prior}; objective {fit.objective:.2f}; weights: {weights}"
        )

    def values(self) -> dict[str, object]:
        """The summary by name."""
        fit = self.fit
        return {
            "method": self.model.method,
            "converged": fit.converged,
            "objective": fit.objective,
            "gradient_norm": fit.gradient_norm,
            "n_episodes": self.model.fit.n_episodes,
            "n_decisions": fit.n_decisions,
            "n_steps": fit.n_steps,
            **({} if self.prior_weight is None else {"prior_weight": self.prior_weight}),
            **{f"weight.{name}": weight for name, weight in self.model.reward_weights.items()},
            **({} if self.knowledge is None else _next_start(self.knowledge)),
        }


def _next_start(known: Knowledge) -> dict[str, float]:
    """Where the next demonstration is expected to teach most."""
    best = known.next_start
    return {"next_x_m": best.x_m, "next_y_m": best.y_m, "next_gain_nats": best.gain_nats}


def save_outcome(output: Path, outcome: FitOutcome, grid: Grid) -> None:
    """Write the model to `output`, and beside it grid, steps of the fit and what it knows."""
    files = outcome_files(output)
    save_grid(files["grid"], grid, outcome.model.scenario)
    atomic_write_text(files["learning"], outcome.trace_table())
    for name in ("posterior", "gain", "gain_map"):
        files[name].unlink(missing_ok=True)  # of an earlier fit
    if outcome.knowledge is not None:
        save_knowledge(files, outcome.knowledge)
    save_model(files["model"], outcome.model)


def outcome_files(output: Path) -> dict[str, Path]:
    """The files beside a model, by what they hold; `serd learn` draws the map."""
    return {
        "model": output,
        "grid": output.with_name("grid.yaml"),
        "learning": output.with_name("learning.csv"),
        "posterior": output.with_name("posterior.csv"),
        "gain": output.with_name("next_demonstration.csv"),
        "gain_map": output.with_name("next_demonstration.png"),
    }

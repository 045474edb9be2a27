"""What a live learner has observed and where its fit stands, on disk against a kill; its fits.

The folder holds `decisions.csv`, every decision learned from or still to learn from, and
`checkpoint.yaml`, where the newest fit stood. A fit runs in a thread of its own, so that the
caller's thread stays free meanwhile.
"""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from serd_app.demonstrations.decision_table import load_decisions, save_decisions
from serd_app.demonstrations.live import LiveDrive, MappedLiveDrive
from serd_app.drives.mapping import BagMapping
from serd_app.learning.learning_files import until_goal
from serd_app.learning.methods import FitProgress, ProgressCallback
from serd_app.learning.outcome import FitOutcome
from serd_bag.errors import FileError
from serd_core.arrays import FloatArray
from serd_core.demonstrations.decisions import TimedDecisions
from serd_core.errors import SerdError
from serd_core.grid.navigation import features_of_flow
from serd_core.learners.fit_result import FitResult
from serd_files.errors import USER_ERRORS
from serd_files.yaml_config import StrictModel, load_yaml_model, save_yaml_model
from serd_sim.scenario.grid import flow_of, goal_states_of, grid_of
from serd_sim.scenario.scenario import Scenario

_STOP_TIMEOUT_S = 10.0


class LearnerCheckpoint(StrictModel):
    """reward_weights: by name, where the newest fit to all episodes stood; none before it.

    patience_s, wait_s: of the scenario, by which its decisions end. step: steps of the fit under
    way, to all episodes or of a candidate weight; 0 between fits.
    n_learned: decisions the newest finished fit had learned from.
    """

    remade_by: ClassVar[str] = "choose another folder or move this one away"

    format: Literal["serd-learner"] = "serd-learner"
    format_version: Literal[2] = 2
    scenario: str
    grid_fingerprint: str
    patience_s: float = Field(gt=0)
    wait_s: float = Field(gt=0)
    reward_weights: dict[str, float] = Field(default_factory=dict)
    step: int = Field(default=0, ge=0)
    n_learned: int = Field(default=0, ge=0)


class CheckpointFolder:
    """Reads and writes the two files; each is replaced whole."""

    def __init__(self, path: Path, scenario: Scenario) -> None:
        self.path, self.scenario = path, scenario
        self._decisions, self._checkpoint = path / "decisions.csv", path / "checkpoint.yaml"

    def new(self) -> LearnerCheckpoint:
        """The checkpoint of a learner without demonstrations."""
        return LearnerCheckpoint(
            scenario=self.scenario.name,
            grid_fingerprint=grid_of(self.scenario).fingerprint(),
            patience_s=self.scenario.patience_s,
            wait_s=self.scenario.wait_s,
        )

    def load(self) -> tuple[LearnerCheckpoint, TimedDecisions] | None:
        """The checkpoint, None where there is none.

        FileError where it is of another grid, or where its decisions ended by other times.
        """
        if not self._decisions.exists() or not self._checkpoint.exists():
            return None
        checkpoint = load_yaml_model(self._checkpoint, LearnerCheckpoint)
        here = self.new()
        if checkpoint.grid_fingerprint != here.grid_fingerprint:
            raise FileError(
                f"{self.path}: was kept on the grid of scenario {checkpoint.scenario!r}, not on "
                f"that of {here.scenario!r}; {here.remade_by}"
            )
        for name in ("patience_s", "wait_s"):
            if (kept := getattr(checkpoint, name)) != (wanted := getattr(here, name)):
                raise FileError(
                    f"{self.path}: was kept with a {name} of {kept:g}, that of the scenario is"
                    f" {wanted:g}; {here.remade_by}"
                )
        return checkpoint, load_decisions(self._decisions)

    def save_decisions(self, decisions: TimedDecisions) -> None:
        """Write the decisions."""
        save_decisions(self._decisions, decisions)

    def save(self, checkpoint: LearnerCheckpoint) -> None:
        """Write where the fit stands."""
        save_yaml_model(self._checkpoint, checkpoint)


class LearnerMemory:
    """Demonstrations as they come, and the newest weights, from and to a checkpoint folder.

    feature_names: of the weights, by default those of the scenario. mapping: of the topics of
    another robot, None for our own.
    """

    def __init__(
        self,
        scenario: Scenario,
        folder: Path,
        *,
        feature_names: Sequence[str] | None = None,
        mapping: BagMapping | None = None,
    ) -> None:
        grid = grid_of(scenario)
        self._feature_names = feature_names or features_of_flow(flow_of(scenario, grid))
        self.folder = CheckpointFolder(folder, scenario)
        loaded = self.folder.load()
        self._checkpoint, earlier = (self.folder.new(), None) if loaded is None else loaded
        self._goals = goal_states_of(scenario, grid)
        #: To learn from, which those in the goal are not.
        self.decisions = None if earlier is None else until_goal(earlier, self._goals)
        given = grid, scenario.patience_s, scenario.wait_s, earlier
        self.drive: LiveDrive | MappedLiveDrive = (
            LiveDrive("live topics", *given)
            if mapping is None
            else MappedLiveDrive(mapping.with_goal(scenario.goal_area_m), *given)
        )

    @property
    def n_decisions(self) -> int:
        """Decisions there are."""
        return 0 if self.decisions is None else len(self.decisions)

    @property
    def unlearned(self) -> bool:
        """Whether there are decisions no finished fit has learned from."""
        return self.n_decisions != self._checkpoint.n_learned

    @property
    def start_remark(self) -> str:
        """Why the next fit cannot begin at the weights that were kept; empty where it can."""
        weights = self._checkpoint.reward_weights
        if not weights or set(weights) == set(self._feature_names):
            return ""
        return (
            f"{self.folder.path}: reward_weights of its checkpoint must be those of"
            f" {', '.join(self._feature_names)}, got {', '.join(weights)}; the next fit"
            " begins without them"
        )

    @property
    def warm_weights(self) -> FloatArray | None:
        """(F,) where the newest fit stood, None before the first."""
        weights = self._checkpoint.reward_weights
        if set(weights) != set(self._feature_names):
            return None
        return np.array([weights[name] for name in self._feature_names])

    def gather(self, *, unfinished: bool) -> tuple[TimedDecisions, TimedDecisions]:
        """Everything observed, which is written too, and of it what to learn from.

        unfinished: see `LiveDrive.gathered`.
        """
        gathered = self.drive.gathered(unfinished=unfinished)
        self.folder.save_decisions(gathered)
        self.decisions = decisions = until_goal(gathered, self._goals)
        return gathered, decisions

    def save_progress(self, progress: FitProgress) -> None:
        """Write where an unfinished fit stands; the weights only of the fit to all episodes."""
        weights = {"reward_weights": self._named(progress.weights)} if progress.is_last else {}
        self._save(step=progress.step.number, **weights)

    def save_learned(self, fit: FitResult) -> None:
        """Write what a finished fit found; the next starts cold where this did not converge."""
        weights = self._named(fit.reward_weights) if fit.converged else {}
        self._save(reward_weights=weights, step=0, n_learned=fit.n_decisions)

    def _save(self, **changes: object) -> None:
        self._checkpoint = LearnerCheckpoint(**(self._checkpoint.model_dump() | changes))
        self.folder.save(self._checkpoint)

    def _named(self, weights: FloatArray) -> dict[str, float]:
        return dict(zip(self._feature_names, weights.tolist(), strict=True))


Job = Callable[[ProgressCallback], FitOutcome]
Event = FitProgress | FitOutcome | SerdError | FileError


class FitStoppedError(SerdError):
    """The fit was stopped before its end."""


class FitWorker:
    """One job at a time; `events` returns its progress in the caller's thread."""

    def __init__(self) -> None:
        self._events: SimpleQueue[Event | BaseException] = SimpleQueue()
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def busy(self) -> bool:
        """Whether a job has begun whose end was not returned by `events` yet."""
        return self._thread is not None

    def begin(self, job: Job) -> None:
        """Run it; the outcome, or the error that ended it, is the last of its events."""
        self._thread = threading.Thread(target=self._run, args=(job,), daemon=True)
        self._thread.start()

    def events(self) -> list[Event]:
        """Everything since the last call; raises an error of the job that is no SerdError."""
        fetched: list[Event] = []
        while True:
            try:
                event = self._events.get_nowait()
            except Empty:
                return fetched
            if not isinstance(event, FitProgress):
                self._thread = None
            if isinstance(event, BaseException) and not isinstance(event, USER_ERRORS):
                raise event
            fetched.append(event)

    def stop(self) -> None:
        """End the job at its next step and wait for that."""
        self._stopped.set()
        if self._thread is not None:
            self._thread.join(_STOP_TIMEOUT_S)

    def _run(self, job: Job) -> None:
        try:
            self._events.put(job(self._report))
        except BaseException as error:
            self._events.put(error)

    def _report(self, progress: FitProgress) -> None:
        if self._stopped.is_set():
            raise FitStoppedError("learning was stopped; start the learner again to continue")
        self._events.put(progress)

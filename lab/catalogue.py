"""All names of `python -m lab`, in the order of its list: what each shows, and its module."""

from dataclasses import dataclass
from importlib import import_module
from typing import Any, get_type_hints


@dataclass(frozen=True)
class Work:
    """A module of the lab that is run by name, and its line in the list."""

    module: str
    about: str


#: Functions of these names in `lab.command.study`.
STUDIES = {
    "hallway": "a populated hallway: who learns what, what arrives when (chapter 5)",
    "robots": "four robots on the same seeds, in two tasks",
    "people": "pedestrians of measured corridors as experts",
}

#: Functions of these names in a module of the same name in `lab.command`.
VALIDATIONS = {
    "faults": "how soon the robot stands when an input fails, with and without the guard",
    "truth": "whether headlines are true: recordings of a foreign robot, and simulated worlds",
    "crowd": "the crowd models beside Weidmann's speeds and recorded corridors",
}

#: Each has a function `run_NAME`; in the order of the thesis.
EXPERIMENTS = {
    name: Work(f"lab.experiments.{module}", about)
    for name, module, about in (
        (
            "minimum-example",
            "minimum_example.explanations",
            "two explanations of one behaviour (section 4.6.1)",
        ),
        (
            "multi-start",
            "minimum_example.multi_start",
            "distinct explanations found by random starts (section 4.1)",
        ),
        ("priors", "priors", "what each prior prefers (section 4.5.4)"),
        ("policy-cost", "policy_cost", "what a gradient costs (Table 4.2)"),
        ("gridworld", "gridworld.experiment", "navigation on satellite images (section 4.6.2)"),
        (
            "ascents",
            "gridworld.ascents",
            "gradient ascent of Algorithm 1 and faster optimisers (section 4.4)",
        ),
        ("routes", "routes", "route choice with many destinations (recursive logit)"),
        ("durations", "durations", "what choices reveal of how long an avoided move takes"),
        ("avoidance", "avoidance", "plans that avoid what few demonstrations leave open"),
        ("rust", "rust", "bus engine replacement (Rust 1987)"),
        (
            "standard-errors",
            "standard_errors",
            "standard errors of misspecified experts against Monte Carlo",
        ),
    )
}

#: Each module has a function `run`, which writes lab/results/NAME.json with underscores.
BENCHMARKS = {
    name.replace("_", "-"): Work(f"lab.benchmarks.{folder}.{name}", about)
    for folder, name, about in (
        ("driving", "crowd_step", "a step of 30 to 1,000 people"),
        ("driving", "live_latency", "age of odometry at a command, and time to the guard's, live"),
        ("driving", "lockstep", "whole steps in process and through ROS, against real time"),
        (
            "learning",
            "intervals",
            "whether 90 % intervals hold the truth, and their width, in seven kinds of worlds",
        ),
        ("learning", "calibration", "ranks of the truth among draws, in seven kinds of worlds"),
        ("learning", "gradient", "objective and gradient against the thesis's computation"),
        ("learning", "joint_dynamics", "alarms of the rule for joint or counted dynamics"),
        ("recordings", "bags_throughput", "reading and copying against rosbags, mcap; memory"),
        ("recordings", "broken_bags", "messages saved of broken recordings, against two libraries"),
    )
}

#: Functions of these names in a module of the same name in `lab.command`.
RUNS = {
    "bench": "ten tasks, a file per method, one table: what each method reaches",
    "benchmarks": "all benchmarks one after the other, or those named",
}
#: Functions of these names in `lab.kept`.
OF_RESULTS = {
    "keep": "writes the tables and figures of docs/results from the results",
    "check": "compares the tables that documents keep with the results",
}

#: Lines by name, under the title of their group.
GROUPS: dict[str, dict[str, str]] = {
    "Studies, resumable": STUDIES,
    "Experiments, resumable": {name: work.about for name, work in EXPERIMENTS.items()},
    "Validations": VALIDATIONS,
    "Benchmarks": {name: work.about for name, work in BENCHMARKS.items()} | RUNS,
    "Results": OF_RESULTS,
}
NAMES = tuple(name for lines in GROUPS.values() for name in lines)


def experiment_named(name: str) -> Any:
    """The experiment of this name, with its function and the model of its settings."""
    from lab.experiments.running.experiment import Experiment

    work = EXPERIMENTS[name]
    run = getattr(import_module(work.module), f"run_{name.replace('-', '_')}")
    return Experiment(name, work.about, get_type_hints(run)["config"], run)

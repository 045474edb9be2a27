"""The flat interface: every name is there, its documents run, and imports stay lazy."""

import importlib
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import serd_core as sc


def test_every_name_of_the_stub_is_the_object_of_its_module(root):
    stub = (root / "serd_core" / "__init__.pyi").read_text()
    homes = re.findall(r"from (\S+) import (?:\(\s*)?(\w+) as \2\b", stub)
    assert len(homes) == len(re.findall(r"(\w+) as \1\b", stub))
    assert {name for _, name in homes} <= set(dir(sc))
    for module, name in homes:
        assert getattr(sc, name) is getattr(importlib.import_module(module), name)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        sc.nothing  # noqa: B018
    with pytest.raises(AttributeError, match=r"'sofT_polcy'; did you mean soft_policy\?"):
        sc.sofT_polcy  # noqa: B018
    names = {}
    exec("from serd_core import *", names)
    assert names.keys() - {"__builtins__"} == set(dir(sc))


def test_importing_the_package_imports_no_module_of_it():
    code = "import sys, serd_core; print(sum(m.startswith('serd_core.') for m in sys.modules))"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "0"


def test_records_are_one_line_of_text_and_tables_in_notebooks(gridworld):
    problem, decisions = gridworld.problem, gridworld.decisions
    fit = sc.fit_mdce_serd(problem, decisions)
    policy = sc.soft_policy(problem, fit.reward_weights, fit.outcome_probabilities)
    information = sc.fit_information(problem, decisions, fit)
    for record in (problem, problem.mdp, problem.mdp.transitions, decisions, policy, fit):
        assert len(repr(record)) < 250, repr(record)
    assert "\n" not in repr((information, sc.standard_errors(problem, information)))
    n_episodes = len(decisions.episodes)
    assert f"{len(decisions)} decisions in {n_episodes} episodes" in repr(decisions)
    assert decisions._repr_html_().count("<tr>") == 7  # header, five decisions, and what is left
    odd = replace(fit, feature_names=("<b>", "other"))
    assert "<td>&lt;b&gt;</td>" in odd._repr_html_()
    assert f"<td>{fit.outcome_probabilities[1, 0]:.3f}</td>" in odd._repr_html_()


def blocks_of(path):
    return re.findall(r"```python\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)


def test_the_page_of_the_library_runs_and_finds_the_truth(root, capsys):
    names = {}
    blocks = blocks_of(root / "docs" / "library.md")
    exec("\n".join(blocks[:1]), names)
    fit, errors = names["fit"], names["errors"]
    assert fit.converged
    assert abs(fit.reward_weights[0] - 20.0) < 3.0 * errors.reward[0]
    exec("\n".join(blocks[1:]), names)
    np.testing.assert_allclose(names["fit"].outcome_probabilities, 1 / 3, atol=0.05)
    assert names["counted"].mdp.n_states == 4
    assert "std. error" in capsys.readouterr().out


def test_the_readme_of_the_distribution_runs(root, capsys):
    (block,) = blocks_of(root / "serd_core" / "README.md")
    exec(block, {})
    assert "converged: yes" in capsys.readouterr().out

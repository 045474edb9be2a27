"""The table of sources in the documents, and the folds of what is held out."""

import numpy as np
import pytest

from lab.benchmarks.recordings import held_out, sources
from lab.benchmarks.report import markdown_row, write_rows
from serd_core.demonstrations.decisions import HIDDEN, Decisions
from serd_core.grid.grid import Action, Grid
from serd_core.grid.navigation import NO_FLOW, build_navigation_problem


def test_only_the_rows_of_the_measured_table_are_replaced(tmp_path):
    document = tmp_path / "sources.md"
    before = "| source | command |\n| --- | --- |\n| a | b |\n\n"
    head = "| source | kind | rest |\n| --- | --- | --- |\n"
    document.write_text(f"{before}{head}| old | x | y |\n\nEnd\n")
    write_rows(document, sources._FIRST_COLUMNS, "| new | 1 | 2 |\n")
    assert document.read_text() == f"{before}{head}| new | 1 | 2 |\n\nEnd\n"
    assert (
        sources._DOCUMENT.read_text().count("\n" + markdown_row(sources._FIRST_COLUMNS).rstrip())
        == 1
    )


def test_folds_are_whole_episodes_or_of_few_a_quarter_of_the_time():
    def decisions(*episodes):
        number = np.repeat(np.arange(len(episodes)), episodes)
        ones = np.ones(len(number), dtype=np.int64)
        return Decisions(number, np.arange(len(number)) * 1.0, ones, ones, ones)

    assert held_out._folds(decisions(1, 2, 1, 1, 1)).tolist() == [0, 1, 1, 2, 3, 0]
    assert held_out._folds(decisions(5, 3)).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]


def test_by_chance_a_hidden_action_counts_by_its_states():
    """In the middle of a room, each of five cells is as likely."""
    problem = build_navigation_problem(
        grid=Grid((0.0, 0.0), 1.0, np.ones((5, 5), bool)),
        flow=np.full(25, NO_FLOW),
        goal_states=[0],
        wall_distance_m=np.ones(25),
        discount=0.9,
    )
    decisions = Decisions([0, 0], [0.0, 1.0], [12, 13], [Action.EAST, HIDDEN], [13, 13])
    found = held_out.uniform_log_likelihood(problem, decisions)
    assert found == pytest.approx(2 * np.log(1 / 5))

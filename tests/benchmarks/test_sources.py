"""The table of sources in the documents, and the folds of what is held out."""

import numpy as np

from benchmarks.sources import likelihood, run
from serd_core.demonstrations.decisions import Decisions


def test_only_the_rows_of_the_measured_table_are_replaced(tmp_path, monkeypatch):
    document = tmp_path / "sources.md"
    before = "| source | command |\n| --- | --- |\n| a | b |\n\n"
    head = "| source | kind | rest |\n| --- | --- | --- |\n"
    document.write_text(f"{before}{head}| old | x | y |\n\nEnd\n")
    monkeypatch.setattr(run, "_DOCUMENT", document)
    run.write("| new | 1 | 2 |\n")
    assert document.read_text() == f"{before}{head}| new | 1 | 2 |\n\nEnd\n"
    real = run._ROOT / "docs" / "sources.md"
    assert len(run._ROWS.findall(real.read_text())) == 1


def test_folds_are_whole_episodes_or_of_few_a_quarter_of_the_time():
    def decisions(*episodes):
        number = np.repeat(np.arange(len(episodes)), episodes)
        ones = np.ones(len(number), dtype=np.int64)
        return Decisions(number, np.arange(len(number)) * 1.0, ones, ones, ones)

    assert likelihood._folds(decisions(1, 2, 1, 1, 1)).tolist() == [0, 1, 1, 2, 3, 0]
    assert likelihood._folds(decisions(5, 3)).tolist() == [0, 0, 1, 1, 2, 2, 3, 3]

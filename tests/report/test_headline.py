"""The headline summarises the run for every outcome."""

from dataclasses import replace

from report.inputs import ReportInputs
from report.page import summary_rows
from report.summary import headline_of, summary_of
from support.episodes import episode_result


def test_all_arrived(inputs: ReportInputs) -> None:
    episodes = tuple(episode_result(i, "arrived", 20.0 + i) for i in range(5))
    sentence = headline_of(summary_of(replace(inputs, episodes=episodes)))
    assert "reached the goal in 5 of 5 new episodes" in sentence
    assert "(100 %; predicted" in sentence
    assert "half of them within 22 s (predicted" in sentence


def test_nobody_arrived(inputs: ReportInputs) -> None:
    episodes = (episode_result(0, "timeout"), episode_result(1, "aborted"))
    summary = summary_of(replace(inputs, episodes=episodes))
    assert "in 0 of 2 new episodes" in headline_of(summary)
    assert headline_of(summary).endswith("fewer than half of them in time.")
    assert summary.measured_mean_s is None
    assert "more than half never arrived" in dict(summary_rows(summary))["Median time of arrival"]

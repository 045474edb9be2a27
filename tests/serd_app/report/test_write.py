"""The whole report: complete, self-contained, escaped, and equal for equal inputs."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from serd_app.learning.knowledge import DynamicsRow, knowledge_of, posterior_of
from serd_app.navigation.comparison import Agreement, agreement
from serd_app.report.charts import OUTCOME_LABELS
from serd_app.report.inputs import FileLink, PhaseTiming
from serd_app.report.summary import summary_of
from serd_app.report.write import write_report
from serd_core.learners.serd import fit_mdce_serd
from serd_files.model_file import Check

FIGURES = {"visitation", "policy", "arrival", "forecast", "outcomes"}
VOID = {"meta", "img", "br", "link", "hr", "input"}


class Page(HTMLParser):
    """Collects tags, addresses, text, and whether every tag is closed in order."""

    def __init__(self, text):
        super().__init__()
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self.text = ""
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.addresses += [str(v) for k, v in attrs if k in {"src", "href", "srcset", "action"}]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def folder(page):
    assert page.name == "report.html"
    return page.parent


@pytest.fixture(scope="module")
def text(page):
    return page.read_text(encoding="utf-8")


def test_the_page_needs_nothing_from_outside(text):
    page = Page(text)
    assert not page.open
    assert "script" not in page.tags
    assert "link" not in page.tags
    assert "@import" not in text
    assert "url(" not in text
    for address in page.addresses:
        assert address.startswith("data:image/svg+xml;base64,") or ":" not in address


def test_the_page_shows_every_figure_with_its_caption_and_both_files(folder, text):
    page = Page(text)
    assert page.tags.count("figure") == page.tags.count("img") == len(FIGURES)
    captions = re.findall(r"<strong>[^<]+\.</strong>([^<]+)</figcaption>", text)
    assert len(captions) == len(FIGURES)
    assert all(len(caption.split()) > 10 for caption in captions)
    for name in FIGURES:
        assert (folder / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert b"<svg" in (folder / "figures" / f"{name}.svg").read_bytes()
    assert "Forecast of the arrival" in page.text
    assert "After 6 demonstrations the robot reached the goal in 3 of 4 new episodes" in page.text
    assert "no prediction" not in page.text
    for address in page.addresses:
        if not address.startswith("data:") and address != "model.yaml":
            assert (folder / address).exists(), address


def test_the_summary_file_holds_the_numbers_of_the_run(folder, text, inputs):
    summary = json.loads((folder / "summary.json").read_text())
    assert summary == json.loads(json.dumps(summary_of(inputs)))
    assert (summary["n_episodes"], summary["n_arrived"]) == (4, 3)
    assert summary["measured_median_s"] == 21.05
    assert summary["robot_on_person_contacts"] == 1
    assert summary["person_on_robot_contacts"] == 2
    assert summary["wall_s"] == {"navigate": 2.0, "learn": 0.5}
    assert sum(summary["decisions_per_model"].values()) == summary["n_decisions"]
    found = agreement(inputs.predicted, inputs.arrival_times_s)
    assert 0 < found.gap_probability < 1
    assert Agreement(**summary["agreement"]) == found
    assert found.gap_text in Page(text).text


@pytest.mark.usefixtures("quick_pictures")
def test_odd_names_are_shown_and_not_obeyed(inputs, tmp_path):
    odd = '<script>alert("x")</script> & $x_1$ "quoted"'
    run = replace(
        inputs.run,
        command=f"serd demo {odd}",
        how=odd,
        seeds={odd: 1},
        versions={odd: odd},
        phases=(PhaseTiming(odd, 1.0, 2.0),),
    )
    strategy = inputs.strategy
    areas = strategy.scenario.start_areas_m
    scenario = strategy.scenario.model_copy(
        update={"name": odd, "start_areas_m": areas | {odd: areas["train"]}}
    )
    files = (FileLink("a <b> & c.yaml", odd),)
    strategy = replace(strategy, scenario=scenario)
    given = replace(inputs, title=odd, run=run, strategy=strategy, files=files)
    page = Page(write_report(given, tmp_path).page.read_text(encoding="utf-8"))
    assert "script" not in page.tags
    assert not page.open
    assert page.text.count(odd) >= 6
    assert "a%20%3Cb%3E%20%26%20c.yaml" in page.addresses


@pytest.fixture(scope="module")
def known(inputs):
    """The inputs with a fit by a posterior, and what it knows."""
    problem, decisions = inputs.strategy.problem, inputs.demonstrations
    fit = fit_mdce_serd(problem, decisions)
    posterior = posterior_of(problem, decisions, fit)
    return replace(inputs, fit=fit, knowledge=knowledge_of(problem, posterior))


@pytest.mark.usefixtures("quick_pictures")
def test_a_fit_with_a_posterior_shows_what_it_knows(known, tmp_path):
    page = Page(write_report(known, tmp_path).page.read_text())
    for row in known.knowledge.outcomes[::5]:
        assert row.known_from in page.text
        assert f"{row.from_choices_nats:.2f}" in page.text
    assert "How long a move takes" in page.text
    for law in known.knowledge.durations:
        assert f"{law.median_s:.2f} ({law.lower_s:.2f} to {law.upper_s:.2f})" in page.text
        assert f"{law.correlation:+.2f}" in page.text
        ends = law.over_forward_median_s, law.over_forward_lower_s, law.over_forward_upper_s
        assert "{:.3g} ({:.3g} to {:.3g})".format(*ends) in page.text
    assert (tmp_path / "figures" / "gain.svg").exists()


def test_counted_and_joint_outcomes_are_side_by_side_with_which_was_taken(tmp_path, inputs):
    """One row of the table for each outcome, and the sentence of the check below it."""
    problem, model = inputs.strategy.problem, inputs.strategy.problem.model_names[0]
    rows = tuple(
        DynamicsRow(name, outcome, 0.1, 0.25 + k / 100, 0.4, 0.2, 0.35 + k / 100, 0.5)
        for name in problem.model_names
        for k, outcome in enumerate(OUTCOME_LABELS)
    )
    check = Check(key="joint_dynamics", mark="holds", sentence="dynamics are counted, as it is so")
    file = inputs.strategy.file.model_copy(update={"checks": (check,)})
    strategy = replace(inputs.strategy, file=file)
    shown = replace(inputs, both=rows, strategy=strategy, knowledge=None)
    page = write_report(shown, tmp_path).page.read_text(encoding="utf-8")
    table = page[page.index('<table class="numbers outcomes">') :].split("</table>")[0]
    assert table.count("<tr>") == 1 + (1 + len(OUTCOME_LABELS)) * len(problem.used_models)
    cells = re.findall(r"<td>(.*?)</td>", table, re.DOTALL)
    assert [re.sub("<[^>]+>", "", each).strip() for each in cells[:3]] == [
        "25.0 % (10.0 to 40.0)",
        "35.0 % (20.0 to 50.0)",
        "moves",
    ]
    assert "known from" in table
    assert (
        f">{model.replace('_', ' ')}, {summary_of(shown)['decisions_per_model'][model]} dec"
        in table
    )
    assert "drives by: dynamics are counted, as it is so." in page
    without = write_report(replace(inputs, knowledge=None), tmp_path).page.read_text()
    first = f"{100 * inputs.fit.initial_outcome_probabilities[0, 0]:.1f} %"
    assert re.search(rf"<td>\s*{re.escape(first)}\s*</td>", without)

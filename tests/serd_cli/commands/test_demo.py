"""A demo that is interrupted goes on where it was; its stacks are stood in for."""

from pathlib import Path

from serd_cli.commands import demo
from serd_cli.output import demo as report
from serd_files.table import EpisodeResult, write_rows
from support.episodes import episode_result


def test_an_interrupted_demo_keeps_what_was_recorded_and_repeats_no_phase_that_was_done(
    serd, monkeypatch
):
    begun, reported, interrupted = [], [], ["demonstrate", "navigate"]

    def stand_in(name, parameters, *_, total, **__):
        is_last = name not in interrupted
        begun.append((name, parameters["seed"]))
        if name == "learn":
            folder.model.touch()
            return
        drives = folder.demonstrations if name == "demonstrate" else folder.navigation
        rows = [episode_result(number, "timeout") for number in range(total - (not is_last))]
        write_rows(drives / "episodes.csv", EpisodeResult, rows)
        if name == "demonstrate":
            folder.bag.mkdir()
            (folder.bag / "metadata.yaml").write_text(f"{len(rows)} episodes")
        if not is_last:
            interrupted.remove(name)
            raise KeyboardInterrupt

    monkeypatch.setattr(demo, "run_stack", stand_in)
    monkeypatch.setattr(report, "report_demo", lambda *found, **_: reported.append(found))
    folder = demo.DemoFolder(Path("demo_output/run-1"))
    given = ("--demonstrations", "3", "--episodes", "2", "--seed", "5")
    assert (ended := serd("demo", *given)).code == 130
    again = f"serd demo --resume {folder.root}"
    assert again in ended.err
    assert serd(*again.split()[1:]).code == 130
    assert serd(*again.split()[1:]).code == 0
    driven = [("demonstrate", 5), ("learn", 5), ("navigate", 1005)]
    assert begun == [driven[0], *driven, driven[2]]
    assert (folder.bag / "metadata.yaml").read_text() == "3 episodes"
    assert (folder.root / "unfinished-1/bag/metadata.yaml").read_text() == "2 episodes"
    ((_, settings, phases),) = reported
    assert (settings.demonstrations, [each.name for each in phases]) == (3, ["navigate"])

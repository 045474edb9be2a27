"""`python -m lab faults`: a table and a picture of what follows the faults of inputs."""

import json


def _faults(lab, *words):
    return lab(
        "faults", "--scenario", "crossing", "--people", "2", "--seeds", "1", "--jobs", "1", *words
    )


def test_rows_and_picture_are_written_and_a_second_run_reuses_them(lab, tmp_path):
    table = tmp_path / "faults.csv"
    words = ("--fault", "scan_nan", "--output", table)
    first = _faults(lab, *words, "--json")
    (without, guarded) = json.loads(first.out)["faults"]
    assert (without["n_stood"], guarded["n_stood"]) == (0, 1)
    assert without["largest_stood_m"] is None
    assert guarded["largest_stood_m"] < 0.6
    assert table.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    written = table.read_bytes()
    assert "scan_nan" in _faults(lab, *words).out
    assert table.read_bytes() == written


def test_a_misspelt_fault_is_refused_before_anything_runs(lab, tmp_path):
    ended = _faults(lab, "--fault", "scan_nam", "--output", tmp_path / "faults.csv")
    assert ended.code == 2
    assert "did you mean 'scan_nan'" in ended.err
    assert not (tmp_path / "faults.csv").exists()


def test_without_a_fault_the_price_is_printed(lab, tmp_path):
    ended = _faults(lab, "--fault", "none", "--output", tmp_path / "faults.csv")
    assert "+0.00 %" in ended.out

"""Generated corridors in the format of the archive."""

import numpy as np
import pytest

_FPS, _WIDTH_M = 16, 2.4


def corridor_text(n_people, seed):
    """People who walk 10 m both ways with a pace of their own and sway; rows in cm."""
    rng = np.random.default_rng(seed)
    rows = [f"# framerate: {_FPS} fps", "# id frame x/cm y/cm z/cm"]
    for person in range(n_people):
        speed = float(np.exp(rng.normal(0.1, 0.15)))
        time_s = np.arange(0, 10.0 / speed, 1 / _FPS)
        middle, drift = rng.uniform(0.3, _WIDTH_M - 0.3), rng.normal(0, 0.05)
        x_m = (-1 if person % 2 else 1) * (speed * time_s - 5.0)
        y_m = middle + drift * time_s + 0.05 * np.sin(2 * time_s + person)
        y_m = np.clip(y_m, 0.1, _WIDTH_M - 0.1)
        first = round((0.5 + 1.2 * person) * _FPS)
        for step, (x, y) in enumerate(zip(x_m, y_m, strict=True)):
            rows.append(f"{person + 1} {first + step} {100 * x:.2f} {100 * y:.2f} 170")
    return "\n".join(rows) + "\n"


@pytest.fixture
def corridor(tmp_path):
    """Factory of files."""

    def make(name="corridor", *, n_people=40, seed=0):
        path = tmp_path / f"{name}.txt"
        path.write_text(corridor_text(n_people, seed))
        return path

    return make

"""Generated corridors in the format of the archive."""

import numpy as np
import pytest

from support.small_problems import make_gridworld, random_problem  # noqa: F401


def corridor_text(
    n_people=40, *, seed=0, width_m=2.4, fps=16, along="x", header=True, two_way=True, spacing_s=1.2
):
    """People who walk 10 m with a pace of their own and sway; the rows of the table in cm."""
    rng = np.random.default_rng(seed)
    rows = [f"# framerate: {fps} fps", "# id frame x/cm y/cm z/cm"] if header else []
    for person in range(n_people):
        sign = -1 if two_way and person % 2 else 1
        speed = float(np.exp(rng.normal(0.1, 0.15)))
        duration_s = 10.0 / speed
        time_s = np.arange(0, duration_s, 1 / fps)
        middle = rng.uniform(0.3, width_m - 0.3)
        drift = rng.normal(0, 0.05)
        x = sign * (speed * time_s - 5.0)
        y = np.clip(
            middle + drift * time_s + 0.05 * np.sin(2 * time_s + person), 0.1, width_m - 0.1
        )
        first = round((0.5 + spacing_s * person) * fps)
        for step, place in enumerate(zip(x, y, strict=True)):
            east, north = place if along == "x" else (place[1], place[0])
            rows.append(f"{person + 1} {first + step} {100 * east:.2f} {100 * north:.2f} 170")
    return "\n".join(rows) + "\n"


@pytest.fixture
def corridor(tmp_path):
    """Factory of files."""

    def make(name="corridor", **settings):
        path = tmp_path / f"{name}.txt"
        path.write_text(corridor_text(**settings))
        return path

    return make

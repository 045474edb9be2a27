import pandas as pd
import pytest

from lab.experiments.information.next_demonstration import (
    CHOSEN,
    RANDOM,
    NextDemonstrationConfig,
    compare_arms,
    needed_table,
)

CONFIG = NextDemonstrationConfig(n_repetitions=1, most=3, test_episodes=10)


@pytest.fixture(scope="module")
def rows():
    return pd.DataFrame(compare_arms(CONFIG, 0))


def test_both_arms_begin_with_the_same_demonstration_and_then_part(rows):
    chosen, random = (rows[rows["arm"] == arm].set_index("size") for arm in (CHOSEN, RANDOM))
    assert chosen.loc[1].drop("arm").equals(random.loc[1].drop("arm"))
    assert chosen.loc[3, "start"] != random.loc[3, "start"]
    assert rows["converged"].all()


def test_three_demonstrations_come_near_the_expert_s_own_likelihood(rows):
    for _, run in rows.groupby("arm"):
        assert run["shortfall"].iloc[-1] < 0.3
        assert run["decisions"].is_monotonic_increasing


@pytest.mark.parametrize(
    ("shortfalls", "needed"), [((0.3, 0.2, 0.01), 3), ((0.05, 0.2, 0.3), 4), ((0.0, 0.0, 0.0), 1)]
)
def test_what_is_needed_is_counted_to_where_it_stays_good_enough(shortfalls, needed):
    rows = [
        {"repetition": 0, "arm": RANDOM, "size": size, "shortfall": value}
        for size, value in enumerate(shortfalls, start=1)
    ]
    assert needed_table(pd.DataFrame(rows), CONFIG)["needed"].tolist() == [needed]

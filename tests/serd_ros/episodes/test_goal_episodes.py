"""Episodes that begin with a goal instead of a reset."""

from serd_ros.episodes.goal_episodes import GoalEpisodes


def test_a_goal_waits_until_its_episode_begins_and_episodes_are_numbered():
    episodes = GoalEpisodes(seed=7, wanted=False)
    assert not episodes.wanted
    episodes.want()
    assert episodes.wanted
    first = episodes.begin(12.5)
    assert (first.episode, first.seed, first.start_s) == (0, 7, 12.5)
    assert not episodes.wanted
    episodes.want()
    episodes.want()
    assert episodes.begin(20.0).episode == 1
    assert not episodes.wanted

"""What the page shows of a person's episode."""

from types import SimpleNamespace

from serd_app.teleop.session import EpisodeTally, Session
from serd_ros.episodes.page_view import episode_values
from serd_sim.scenario.scenario import load_scenario
from support.observations import observation_at


def test_an_episode_runs_once_it_can_be_discarded():
    session = Session(load_scenario("hallway"), timeout_s=10.0)
    episodes = SimpleNamespace(
        session=session, number=1, n_decisions=0, other_driver="", tally=EpisodeTally()
    )
    session.start()
    assert episode_values(episodes)["phase"] == "starting"
    session.world_reset(0.0)
    assert episode_values(episodes)["phase"] == "starting"
    session.observe(observation_at(1.5, 1.5))
    assert episode_values(episodes)["phase"] == "running"
    session.discard()
    assert episode_values(episodes)["phase"] == "ended"

"""Mutated messages on every subscription of every node: nothing ends it and no callback fails.

The subscriptions are those of the running nodes. Each node gets valid messages between the mutated
ones, and publishes on the same topics afterwards as before. SERD_FUZZ_CASES sets the number of
mutations per subscription (50), SERD_FUZZ_SEED the seed (0).
"""

import os
import random
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from serd_app.drives.drive import EpisodeMark
from serd_core.grid.grid import Action
from serd_ros.convert.diagnostics import to_episode_message
from serd_ros.convert.stamp import stamp_s
from serd_ros.endpoints import qos, topics
from serd_ros.endpoints.followed_topic import PeopleTopic, Received
from serd_ros.endpoints.topic_types import TF_TYPE, TopicType
from serd_ros.graph.graph import load_graph
from serd_ros.nodes.demo_recorder import DemoRecorderNode
from serd_ros.nodes.hallway_sim import HallwaySim
from serd_ros.nodes.teleop_page import TeleopPageNode
from serd_sim.episodes.episode import EpisodeStart
from support.message_mutations import mutated, mutated_cdr
from support.nodes_in_process import NodeInProcess, deliver, needed_parameters, node_in_process
from support.people_messages import DETECTIONS, PEOPLE, TRACKED, PeopleMessages
from support.valid_messages import valid_message
from support.waiting import wait_until

N_MUTATIONS = int(os.environ.get("SERD_FUZZ_CASES", "50"))
IS_FUZZ = "SERD_FUZZ_CASES" in os.environ
SEED = int(os.environ.get("SERD_FUZZ_SEED", "0"))
MUTATED_BETWEEN_VALID = 20
TICK_S, TICKS_PER_DECISION = 0.05, 40
START_S = 100.0
MOST_GROWTH_MB = 300.0
#: Topics on which a sound world sends little.
RARE = ("goal_pose", "goal_area", "model", "map")

OWN_ROBOT = {"lockstep": False, "people_from": "none", "stamp_tolerance_s": 0.1}
#: Parameters with which nodes run; other nodes run once, with their defaults.
VARIANTS: dict[str, list[dict[str, object]]] = {
    "hallway_sim": [
        {"people": 3, "lockstep": False},
        {"people": 3, "lockstep": True, "lockstep_timeout_s": 1e6},
    ],
    "local_planner": [
        {"lockstep": False, "required_nodes": [""]},
        {"lockstep": True, "required_nodes": [""]},
        {**OWN_ROBOT, "pose_from": "tf"},
    ],
    "people_tracker": [{}, {"pose_from": "tf", "stamp_tolerance_s": 0.1}],
    "guard": [{"lockstep": False}, {"lockstep": True, "required_nodes": [""]}],
    "scripted_expert": [{"episodes": 1_000_000}],
    "strategy": [{"episodes": 1_000_000, "reset": reset} for reset in (True, False)[: 1 + IS_FUZZ]],
    "teleop_mux": [{"use_sim_time": True}, {"stamped_cmd_vel": True}],
    "learner": [{"learn_on": "call"}],
    "nav2_bridge": [{}, {"mode": "through_poses"}],
}
CASES = [
    (kind, parameters)
    for kind, node in load_graph().nodes.items()
    for parameters in VARIANTS.get(kind, [{}])
    if node.subscribes
]


class Session:
    """A node that is fed; the time of its messages goes on."""

    def __init__(self, running: NodeInProcess, model: str) -> None:
        self.running, self.node = running, running.node
        self._model = model
        self._time_s = START_S
        self.n_sent = 0

    def messages(self, subscription) -> Iterator[object]:
        """Valid messages for a subscription, as objects."""
        topic = subscription.topic_name.strip("/")
        time_s = self._time_s
        if isinstance(self.node, HallwaySim) and topic == "cmd_vel":
            time_s = stamp_s(self.running.sent["clock"].clock)
        if topic == "model":
            yield subscription.msg_type(data=self._model)
            return
        yield valid_message(topic, time_s, subscription.msg_type)
        if topic == "episode":
            mark = EpisodeMark("end", time_s, 1, "scripted_expert", 0, "train", "arrived")
            yield to_episode_message(mark)

    def prepare(self) -> None:
        """Have an episode run and a person drive."""
        node = self.node
        if runner := getattr(self.running.work, "runner", None):
            runner._starter._look.cancel()
            if not runner.driving:
                place = {"episode": 0, "seed": 0, "start_area": "train"}
                runner._starter.begin(EpisodeStart(**place, start_s=self._time_s - TICK_S))
        if isinstance(node, TeleopPageNode):
            node.choice.hold(None)
            node.choice.hold(Action.NORTH)
            node._heard_s = node.wall_s()
        if isinstance(node, HallwaySim):
            assert self.running.call("reset", None).success
        self.feed(1)

    def feed(self, n_ticks: int, mutated_topic: str = "") -> set[str]:
        """Send what a sound world sends; the topics that the node published on meanwhile.

        mutated_topic: between its mutations no rare message comes, for a plan costs a node 0.1 s,
        unless this topic is rare itself.
        """
        before = self.running.published.copy()
        unsent = RARE if mutated_topic and mutated_topic not in RARE else ()
        for tick in range(n_ticks):
            self._time_s = round((self._time_s + TICK_S) / TICK_S) * TICK_S
            for subscription in list(self.node.subscriptions):
                if subscription.topic_name.strip("/") in (RARE if tick else unsent):
                    continue
                for message in self.messages(subscription):
                    self.send(subscription, message)
            self.running.wait(TICK_S)
            self.running.call_timers()
        return set(self.running.published - before)

    def work(self) -> set[str]:
        """Topics of two decision periods of work."""
        self.prepare()
        return self.feed(2 * TICKS_PER_DECISION)

    def send(self, subscription, message: object) -> None:
        """Call the subscription; raw ones take bytes."""
        raw = subscription.raw and not isinstance(message, bytes)
        deliver(subscription, serialize_message(message) if raw else message)
        self.n_sent += 1

    def send_mutated(self, subscription, rng: random.Random) -> None:
        """One mutated message; an error states it."""
        valid = rng.choice(list(self.messages(subscription)))
        as_bytes = isinstance(valid, bytes) or (subscription.raw and rng.random() < 0.5)
        message = mutated_cdr(valid, rng) if as_bytes else mutated(valid, rng)
        try:
            self.send(subscription, message)
            if rng.random() < 0.25:
                self.running.call_timers()
        except Exception as error:
            raise AssertionError(f"{subscription.topic_name}: {str(message)[:3000]}") from error


def follow_tf(running: NodeInProcess) -> None:
    """Let the node subscribe to /tf, which it does where there is a publisher."""
    running.node.create_publisher(TopicType(TF_TYPE).message, topics.TF, qos.TF)
    wait_until(lambda: running.subscriptions("tf"), turn=running.call_timers)


def memory_mb() -> float:
    """Resident memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def raising(guard) -> None:
    """Let unexpected exceptions out, with their traceback, but those of rclpy's own callbacks."""
    note = guard.note

    def out(name, callback, error):
        if not getattr(callback, "__module__", "").startswith("rclpy."):
            raise error
        note(name, callback, error)

    guard.note = out


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.usefixtures("nav2_server")
@pytest.mark.parametrize(("kind", "parameters"), CASES)
def test_no_message_ends_a_node_or_fails_in_it(kind, parameters, tmp_path, save_model_of):
    model = save_model_of()
    given = needed_parameters(tmp_path, model).get(kind, {}) | parameters
    with node_in_process(kind, **given) as running:
        raising(running.node.callbacks)
        if parameters.get("pose_from") == "tf":
            follow_tf(running)
        session = Session(running, model.read_text())
        published = session.work()
        before_mb = memory_mb()
        for subscription in list(running.node.subscriptions):
            rng = random.Random(f"{SEED} {subscription.topic_name}")
            for number in range(N_MUTATIONS):
                if number % MUTATED_BETWEEN_VALID == 0:
                    session.feed(1, subscription.topic_name.strip("/"))
                session.send_mutated(subscription, rng)
        # A busy machine can take longer than a held key counts, so that the node stops driving.
        wait_until(lambda: session.work() >= published, turn=lambda: None)
        if isinstance(running.node, DemoRecorderNode):  # it has all but those without a stamp
            n_kept = session.n_sent - running.node.callbacks.n_rejected
            assert running.work._recorder.status.n_messages == n_kept
        running.assert_alive()
        assert memory_mb() - before_mb < MOST_GROWTH_MB


@pytest.mark.ros
@pytest.mark.slow
@pytest.mark.parametrize("name", [PEOPLE, TRACKED, DETECTIONS])
def test_no_people_of_another_type_end_a_node_or_fail_in_it(name):
    made, rng, taken = PeopleMessages(), random.Random(f"{SEED} {name}"), []
    with node_in_process("teleop_mux") as running:
        callbacks = running.node.callbacks
        raising(callbacks)
        topic = PeopleTopic(running.node.endpoints, "people", lambda *seen: taken.append(seen))
        topic._change_type({name: ""})
        take = callbacks.of_messages("people", topic._on_message)
        for number in range(N_MUTATIONS):
            valid = made.encode(name, START_S + number, [[1.0, 2.0], [4.0, 0.5]], np.ones((2, 2)))
            take(Received("/people", mutated_cdr(valid, rng), 0, 0))
            if number % MUTATED_BETWEEN_VALID == 0:
                n_taken = len(taken)
                take(Received("/people", valid, 0, 0))
                assert len(taken) == n_taken + 1
        assert callbacks.n_rejected > N_MUTATIONS // 10
        running.assert_alive()

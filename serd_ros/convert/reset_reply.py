"""What the `reset` service answers, as the sentence a std_srvs/Trigger response can carry."""

import re
from dataclasses import dataclass

from serd_ros.errors import NodeError

_SENTENCE = re.compile(r"episode (\d+) with seed (\d+) begins in (\S+) at (\d+\.\d+) s")


@dataclass(frozen=True)
class ResetReply:
    """The episode that begins now; observations before start_s belong to the one before."""

    episode: int
    seed: int
    start_area: str
    start_s: float


def to_reset_sentence(reply: ResetReply) -> str:
    """The reply in words."""
    return (
        f"episode {reply.episode} with seed {reply.seed} begins in {reply.start_area} "
        f"at {reply.start_s:.9f} s"
    )


def from_reset_sentence(sentence: str) -> ResetReply:
    """The reply its words mean; NodeError for any other sentence."""
    match = _SENTENCE.fullmatch(sentence)
    if match is None:
        raise NodeError(f"reset answered {sentence!r}; drive a world that hallway_sim runs")
    return ResetReply(int(match[1]), int(match[2]), match[3], float(match[4]))

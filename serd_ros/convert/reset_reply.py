"""What the `reset` service answers, as the sentence a std_srvs/Trigger response can carry."""

import re
from dataclasses import dataclass

from serd_ros.errors import NodeError

_SENTENCE = re.compile(r"episode (\d+) with seed (\d+) begins in (\S+)")


@dataclass(frozen=True)
class ResetReply:
    """The episode that begins now."""

    episode: int
    seed: int
    start_area: str


def to_reset_sentence(reply: ResetReply) -> str:
    """The reply in words."""
    return f"episode {reply.episode} with seed {reply.seed} begins in {reply.start_area}"


def from_reset_sentence(sentence: str) -> ResetReply:
    """The reply its words mean; NodeError for any other sentence."""
    match = _SENTENCE.fullmatch(sentence)
    if match is None:
        raise NodeError(f"reset answered {sentence!r}; drive a world that hallway_sim runs")
    return ResetReply(int(match[1]), int(match[2]), match[3])

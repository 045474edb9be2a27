"""Episodes without a reset: each begins where the robot is, when there is a goal to drive to.

So a real robot drives, and the simulated one when goals come by hand: nobody carries it back to a
start, and nobody counts contacts for it.
"""

from serd_ros.convert.reset_reply import ResetReply

#: What stands for the start area of an episode that began anywhere.
ANYWHERE = "anywhere"
#: What is known of contacts where no simulated world counts them: nothing.
UNCOUNTED = {
    "robot_on_person": "0",
    "person_on_robot": "0",
    "robot_on_wall": "0",
    "minimum_person_distance_m": "nan",
}


class GoalEpisodes:
    """Numbers episodes and remembers whether a goal still waits to be driven to."""

    def __init__(self, seed: int, *, wanted: bool) -> None:
        self._seed, self._wanted = seed, wanted
        self._count = 0

    @property
    def wanted(self) -> bool:
        """Whether a goal waits."""
        return self._wanted

    def want(self) -> None:
        """A goal has come."""
        self._wanted = True

    def begin(self, now_s: float) -> ResetReply:
        """The next episode, from `now_s` on; its goal waits no more."""
        self._wanted = False
        self._count += 1
        return ResetReply(self._count - 1, self._seed, ANYWHERE, now_s)

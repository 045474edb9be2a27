"""Puts an observation together from parts that arrive by themselves, by their stamps."""

from sim.world.observation import NO_PEOPLE, Observation, People, Pose, make_observation


class ObservationInbox:
    """Keeps the newest pose, speeds and people, each with its stamp (ns).

    The simulator stamps the three alike; `synchronised` gives an observation once per stamp, when
    all three parts of it are there. `latest` mixes stamps, for robots whose sensors run apart.
    needs_people: when False, observations have no people and wait for pose and speeds only.
    """

    def __init__(self, control_period_s: float, *, needs_people: bool = True) -> None:
        self._needs_people = needs_people
        self._control_period_s = control_period_s
        self._pose: tuple[int, Pose] | None = None
        self._speeds: tuple[int, tuple[float, float]] | None = None
        self._people: tuple[int, People] | None = None

    def take_pose(self, time_ns: int, pose: Pose) -> Observation | None:
        """Take a pose; the observation it completes, if it does."""
        self._pose = time_ns, pose
        return self.synchronised()

    def take_speeds(self, time_ns: int, speeds: tuple[float, float]) -> Observation | None:
        """Take speeds (m/s, rad/s); the observation they complete, if they do."""
        self._speeds = time_ns, speeds
        return self.synchronised()

    def take_people(self, time_ns: int, people: People) -> Observation | None:
        """Take the people; the observation they complete, if they do."""
        if not self._needs_people:
            return None
        self._people = time_ns, people
        return self.synchronised()

    def synchronised(self) -> Observation | None:
        """The observation whose three parts have one stamp, None when they differ."""
        if self._pose is None or self._speeds is None or self._pose[0] != self._speeds[0]:
            return None
        if self._needs_people and (self._people is None or self._people[0] != self._pose[0]):
            return None
        return self.latest()

    def latest(self) -> Observation | None:
        """The newest parts as one observation at the pose's time, None while one is missing."""
        if self._pose is None or self._speeds is None:
            return None
        if self._needs_people and self._people is None:
            return None
        people = NO_PEOPLE if self._people is None else self._people[1]
        time_s = self._pose[0] * 1e-9
        return make_observation(
            time_s=time_s,
            tick=round(time_s / self._control_period_s),
            pose=self._pose[1],
            speed_mps=self._speeds[1][0],
            yaw_rate_radps=self._speeds[1][1],
            people_position_m=people.position_m,
            people_velocity_mps=people.velocity_mps,
            people_id=people.identity,
        )

"""Puts an observation together from parts that arrive by themselves, by their stamps."""

from serd_sim.world.observation import NO_PEOPLE, Observation, People, Pose, make_observation


class ObservationInbox:
    """Keeps the newest pose, speeds and people, each with its stamp (ns).

    tolerance_s: 0 gives an observation once per stamp, when all its parts have that stamp, as a
    simulator stamps them. Above 0, each pose gives an observation with the newest other parts,
    whose stamps may be this far from its own, as on robots whose sensors run apart.
    needs_people: when False, observations have no people and wait for pose and speeds only.
    """

    def __init__(
        self, control_period_s: float, *, needs_people: bool = True, tolerance_s: float = 0.0
    ) -> None:
        self._needs_people = needs_people
        self._tolerance_ns = round(tolerance_s * 1e9)
        self._control_period_s = control_period_s
        self._pose: tuple[int, Pose] | None = None
        self._speeds: tuple[int, tuple[float, float]] | None = None
        self._people: tuple[int, People] | None = None

    def take_pose(self, time_ns: int, pose: Pose) -> Observation | None:
        """Take a pose; the observation it completes, if it does."""
        self._pose = time_ns, pose
        return self._complete()

    def take_speeds(self, time_ns: int, speeds: tuple[float, float]) -> Observation | None:
        """Take speeds (m/s, rad/s); the observation they complete, if they do."""
        self._speeds = time_ns, speeds
        return None if self._tolerance_ns else self._complete()

    def take_people(self, time_ns: int, people: People) -> Observation | None:
        """Take the people; the observation they complete, if they do."""
        if not self._needs_people:
            return None
        self._people = time_ns, people
        return None if self._tolerance_ns else self._complete()

    def missing(self) -> dict[str, float | None]:
        """The parts that no observation can be made without: None for one that has never come,
        else by how much (s) it is older than the pose; negative when newer."""
        stamps_ns = {
            "pose": None if self._pose is None else self._pose[0],
            "odom": None if self._speeds is None else self._speeds[0],
        }
        if self._needs_people:
            stamps_ns["people"] = None if self._people is None else self._people[0]
        found: dict[str, float | None] = {}
        for name, stamp_ns in stamps_ns.items():
            if stamp_ns is None:
                found[name] = None
            elif self._pose is not None and abs(self._pose[0] - stamp_ns) > self._tolerance_ns:
                found[name] = (self._pose[0] - stamp_ns) * 1e-9
        return found

    def _complete(self) -> Observation | None:
        if self._pose is None or self._speeds is None or self.missing():
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

"""People as the lidar alone tells: observations whose people come from scans."""

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from sim.crowd.social_force import model_named
from sim.errors import SimError
from sim.geometry.occupancy import wall_distance_raster
from sim.perception.people_tracker import PeopleTracker, TrackerState
from sim.perception.scan_people import people_in_scan
from sim.scenario.scenario import Scenario
from sim.world.observation import Observation, make_observation


class ScanPerception:
    """Replaces the people of observations by those tracked in the scans taken so far."""

    def __init__(self, scenario: Scenario) -> None:
        lidar = scenario.lidar
        self.tracker = PeopleTracker()
        self._walls = wall_distance_raster(scenario)
        self._person_radius_m = model_named(scenario.pedestrians.model).body_radius_m
        self._angles_rad: FloatArray = lidar.angle_min_rad + lidar.angle_increment_rad * np.arange(
            lidar.n_rays, dtype=np.float64
        )

    def reset(self) -> None:
        """Forget everybody, at the start of an episode."""
        self.tracker.reset()

    def take(self, observation: Observation, ranges_m: NDArray[np.float32]) -> None:
        """Take the scan (n_rays,) that was made at an observation's time and pose."""
        if ranges_m.shape != self._angles_rad.shape:
            raise SimError(
                f"ranges_m must have {len(self._angles_rad)} rays as lidar.n_rays of the scenario"
                f", got {ranges_m.shape}; set lidar.n_rays to those of the sensor"
            )
        found = people_in_scan(
            ranges_m, self._angles_rad, observation.pose, self._walls, self._person_radius_m
        )
        self.tracker.update(found, observation.time_s)

    def see(self, observation: Observation) -> Observation:
        """The observation with the people tracked, moved on to its time, for the given ones."""
        self.tracker.predict(observation.time_s)
        return make_observation(
            time_s=observation.time_s,
            tick=observation.tick,
            pose=observation.pose,
            speed_mps=observation.speed_mps,
            yaw_rate_radps=observation.yaw_rate_radps,
            people_position_m=self.tracker.position_m,
            people_velocity_mps=self.tracker.velocity_mps,
            people_id=self.tracker.identity,
        )

    def snapshot(self) -> TrackerState:
        """Copy of all that changes."""
        return self.tracker.snapshot()

    def restore(self, state: TrackerState) -> None:
        """Go back to a snapshot."""
        self.tracker.restore(state)

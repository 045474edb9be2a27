"""People as the lidar alone tells: observations whose people come from scans."""

import numpy as np
from numpy.typing import NDArray

from serd_core.arrays import FloatArray
from sim.crowd.social_force import model_named
from sim.observation import Observation, make_observation
from sim.occupancy import wall_distance_raster
from sim.perception.people_tracker import PeopleTracker
from sim.perception.scan_people import people_in_scan
from sim.scenario import Scenario


class ScanPerception:
    """Replaces the people of observations by those tracked in the scans seen so far."""

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

    def see(self, observation: Observation, ranges_m: NDArray[np.float32] | None) -> Observation:
        """The observation with tracked people; None between scans."""
        if ranges_m is None:
            self.tracker.predict(observation.time_s)
        else:
            found = people_in_scan(
                ranges_m, self._angles_rad, observation.pose, self._walls, self._person_radius_m
            )
            self.tracker.update(found, observation.time_s)
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

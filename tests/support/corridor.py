"""A guard in a closed corridor that the lidar of a robot sees, with faults of its scans."""

import math

import numpy as np

from serd_sim.safety.guard import Guard
from serd_sim.safety.scan import Scan, ScanGeometry
from serd_sim.safety.settings import GuardSettings
from serd_sim.world.command import Command

PERIOD_S = 0.05
RADIUS_M = 0.25
AHEAD = Command(1.2, 0.0)


def unchanged(ranges_m, _):
    return ranges_m


class Corridor:
    """A robot that obeys its guard; walls at x = wall_m and -3 m, and at the sides.

    change: function of the ranges and the robot's x. field_rad: of view. scan_ticks: control
    periods between two scans. lidar_x_m: place of the lidar ahead of the robot's centre.
    """

    def __init__(
        self,
        change=unchanged,
        *,
        wall_m=6.0,
        sides_m=(-1.5, 1.5),
        range_m=(0.1, 12.0),
        n_rays=360,
        field_rad=math.tau,
        start=(0.0, 0.0, 0.0),
        scan_ticks=2,
        walls_m=None,
        lidar_x_m=0.0,
        acceleration_mps2=2.5,
        **settings,
    ):
        sources = ("scan",) if walls_m is None else ("robot_pose", "scan")
        self.settings = GuardSettings(
            **{"observation_sources": sources, "radius": RADIUS_M, "max_vel_x": 1.2}
            | {"sensor_x": lidar_x_m, "acc_lim_x": acceleration_mps2}
            | settings
        )
        self.lidar_x_m, self.acceleration_mps2 = lidar_x_m, acceleration_mps2
        self.guard = Guard(self.settings, walls_m)
        self.change, self.wall_m, self.sides_m = change, wall_m, sides_m
        closed = field_rad > 6.2
        self.geometry = ScanGeometry(
            -field_rad / 2, field_rad / (n_rays if closed else n_rays - 1), *range_m
        )
        self.angles_rad = self.geometry.angles_rad(n_rays)
        self.pose, self.speeds, self.time_s = start, (0.0, 0.0), 0.0
        self.rng = np.random.default_rng(0)
        self.scan_ticks, self.twist = scan_ticks, lambda speeds: speeds
        self.outputs = []

    @property
    def gap_m(self):
        """Between the body and the wall ahead."""
        return self.wall_m - self.pose[0] - RADIUS_M

    @property
    def faults(self):
        """Names of all faults that occurred."""
        return {reason.fault.name for output in self.outputs for reason in output.reasons}

    def ranges_m(self):
        x_m, y_m, yaw_rad = self.pose
        x_m += self.lidar_x_m * math.cos(yaw_rad)
        y_m += self.lidar_x_m * math.sin(yaw_rad)
        along = np.cos(self.angles_rad + yaw_rad), np.sin(self.angles_rad + yaw_rad)
        ranges_m = np.full(len(self.angles_rad), np.inf)
        right_m, left_m = self.sides_m
        planes = (self.wall_m - x_m, 0), (-3.0 - x_m, 0), (left_m - y_m, 1), (right_m - y_m, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            for away_m, axis in planes:
                reached_m = away_m / along[axis]
                ranges_m = np.where(reached_m > 0.0, np.minimum(ranges_m, reached_m), ranges_m)
        ranges_m += self.rng.normal(0.0, 0.01, len(ranges_m))
        ranges_m[ranges_m > self.geometry.range_max_m] = np.inf
        return self.change(ranges_m, self.pose[0]).astype(np.float32)

    def tick(self, command=AHEAD):
        guard, now_s = self.guard, self.time_s
        guard.advance(now_s)
        guard.receive_odometry(now_s, self.pose, self.twist(self.speeds))
        guard.receive_pose(now_s, self.pose)
        if round(now_s / PERIOD_S) % self.scan_ticks == 0:
            guard.receive_scan(Scan(now_s, self.ranges_m(), self.geometry))
        guard.receive_command(now_s, command)
        output = guard.step(now_s)
        self.outputs.append(output)
        most = self.acceleration_mps2 * PERIOD_S
        change = min(max(output.command.linear_mps - self.speeds[0], -most), most)
        speed_mps, turn_radps = self.speeds[0] + change, output.command.angular_radps
        x_m, y_m, yaw_rad = self.pose
        yaw_rad += turn_radps * PERIOD_S
        x_m += speed_mps * PERIOD_S * math.cos(yaw_rad)
        y_m += speed_mps * PERIOD_S * math.sin(yaw_rad)
        self.pose, self.speeds = (x_m, y_m, yaw_rad), (speed_mps, turn_radps)
        self.time_s = now_s + PERIOD_S
        assert self.gap_m > 0.0 or self.speeds[0] == 0.0, f"hit at {speed_mps:.2f} m/s"
        return output

    def run(self, duration_s=12.0, command=AHEAD):
        """Drive by a command; AssertionError where the robot hits the wall ahead."""
        for _ in range(round(duration_s / PERIOD_S)):
            self.tick(command)
        return self

    def sector(self, value, degrees, *, after_m=3.0, centre_deg=0.0):
        """Let the rays of a sector read a value once the robot has come so far."""
        aside = np.abs((np.degrees(self.angles_rad) - centre_deg + 180.0) % 360.0 - 180.0)

        def change(ranges_m, x_m):
            return np.where((aside < degrees / 2) & (x_m >= after_m), value, ranges_m)

        self.change = change
        return self

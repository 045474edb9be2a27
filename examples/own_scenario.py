"""A scenario of your own: a room with a table, in which the simulated robot drives.

Writes room.yaml, its plan room.png, and prints how an expert drives there among people. The same
file is for `serd demo --scenario room.yaml` and `serd launch navigate scenario:=room.yaml`.
"""

from pathlib import Path

from serd_app.report.maps import save_plan
from serd_sim.drivers.catalogue import make_driver
from serd_sim.episodes.episode import run_episode
from serd_sim.planning.local_planner import make_planner
from serd_sim.scenario.scenario import load_scenario
from serd_sim.world.world import HallwayWorld

ROOM = """
name: room
description: Room of 8 m x 6 m with a table; the goal is behind it.
walkable_area_m: [[0, 0], [8, 0], [8, 6], [0, 6]]
obstacles:
  - name: table
    outline_m: [[3, 2], [5, 2], [5, 4], [3, 4]]
goal_area_m: [[6, 4], [8, 4], [8, 6], [6, 6]]
start_areas_m:
  train: [[0, 0], [2, 0], [2, 2], [0, 2]]
pedestrians:
  count: 4
  loops:
    - name: round the table
      waypoints_m: [[1.5, 1], [6.5, 1], [6.5, 5], [1.5, 5]]
      lane_half_width_m: 0.5
robot: {drive: kinematic}
"""

Path("room.yaml").write_text(ROOM, encoding="utf-8")
scenario = load_scenario("room.yaml")
save_plan(Path("room.png"), scenario)
with HallwayWorld(scenario, seed=1) as world:
    expert = make_driver("expert", scenario, 1)
    for episode in range(3):
        record = run_episode(world, make_planner(scenario), expert, episode=episode)
        print(f"{record.outcome} after {record.duration_s:.1f} s, {record.decisions}")

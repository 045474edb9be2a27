"""JuPedSim: its social force model and its collision-free speed model, in C++.

The social force is stiff: steps of 0.05 s threw people out of the corridor, so that it takes five
steps of 0.01 s, its default, for each of the others'.
"""

from importlib.metadata import version

import jupedsim
from crowd_task import answer, read_task, seconds_per_step

task = read_task()
width_m, length_m = task["width_m"], task["length_m"]


def steps_of(model, agent_parameters, n_substeps: int) -> float:
    """Seconds per step of a model; people turn round at the ends, so none leave."""
    simulation = jupedsim.Simulation(
        model=model,
        geometry=[(0.0, 0.0), (length_m, 0.0), (length_m, width_m), (0.0, width_m)],
        dt=task["step_s"] / n_substeps,
    )
    ends = [simulation.add_waypoint_stage((x_m, width_m / 2), 2.0) for x_m in (1.0, length_m - 1)]
    journey = jupedsim.JourneyDescription(ends)
    for here, there in (ends, ends[::-1]):
        journey.set_transition_for_stage(here, jupedsim.Transition.create_fixed_transition(there))
    number = simulation.add_journey(journey)
    for each in task["people"]:
        simulation.add_agent(
            agent_parameters(
                position=(each["x_m"], each["y_m"]),
                desired_speed=each["speed_mps"],
                radius=task["radius_m"],
                journey_id=number,
                stage_id=ends[1] if each["goal_m"][0] > each["x_m"] else ends[0],
            )
        )
    count = simulation.agent_count()
    seconds = seconds_per_step(lambda: simulation.iterate(n_substeps))
    assert simulation.agent_count() == count == len(task["people"])
    return seconds


answer(
    f"JuPedSim {version('jupedsim')}",
    {
        "social force with body contact, walls, way-finding, five steps of 0.01 s": steps_of(
            jupedsim.SocialForceModel(), jupedsim.SocialForceModelAgentParameters, 5
        ),
        "collision-free speed, walls, way-finding": steps_of(
            jupedsim.CollisionFreeSpeedModel(), jupedsim.CollisionFreeSpeedModelAgentParameters, 1
        ),
    },
)

from support.small_problems import gridworld, make_gridworld, minimum_example, random_problem  # noqa: F401

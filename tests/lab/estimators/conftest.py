from support.small_problems import make_gridworld, minimum_example, random_problem  # noqa: F401

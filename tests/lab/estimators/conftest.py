from support.small_problems import (  # noqa: F401
    gridworld,
    make_gridworld,
    minimum_example,
    random_problem,
)

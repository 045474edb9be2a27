from support.small_problems import (  # noqa: F401
    counted,
    gridworld,
    make_gridworld,
    minimum_example,
    random_problem,
)

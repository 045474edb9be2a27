"""Settings of the learning recipe."""

from storage.settings import setting
from storage.yaml_config import StrictModel


class LessonSettings(StrictModel):
    """How rewards and dynamics are learned from decisions."""

    minimum_decisions: int = setting(20, "refuse to learn from fewer decisions", ge=1)
    seed: int = setting(0, "seed of the random starts", ge=0)
    discount: float = setting(0.99, "discount of the reward", ge=0, lt=1)
    prior_weight: float = setting(
        0.1, "weight lambda of the divergence prior to the M-estimate", ge=0
    )
    pseudo_count: float = setting(1.0, "uniform prior of the M-estimate: added counts", gt=0)
    starts: int = setting(4, "random starts of the weights; the best fit is used", ge=1)

"""How a lesson is learned, whoever asks for it."""

from pydantic import Field

from storage.yaml_config import StrictModel


class LessonSettings(StrictModel):
    """See the learner in nodes.yaml for what each means."""

    minimum_decisions: int = Field(ge=1)
    seed: int = Field(ge=0)
    discount: float = Field(ge=0, lt=1)
    prior_weight: float = Field(ge=0)
    pseudo_count: float = Field(gt=0)
    starts: int = Field(ge=1)

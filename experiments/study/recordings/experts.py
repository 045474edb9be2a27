"""Who demonstrates in the study: the scripted people, and experts who plan."""

from experiments.study.recordings.planned_experts import BELIEFS

PEOPLE = "people"
EXPERTS = (PEOPLE, *BELIEFS)

"""The nearest right name."""

from serd_bag.nearest import choice_rule, hint


def test_the_hint_offers_the_nearest_or_all():
    for slip in ("juncton", "JUNCTION"):
        assert hint(slip, ["hallway", "junction"]) == "did you mean 'junction'?"
    assert hint("zebra", ["junction", "hallway"]) == "choose from hallway, junction"
    assert hint("zebra", []) == "none is known"


def test_a_rule_names_the_choices_and_only_a_near_one_as_meant():
    rule = "place must be one of hallway, junction, got "
    choices = ["hallway", "junction"]
    assert (
        choice_rule("place", "junktion", choices) == f"{rule}'junktion'; did you mean 'junction'?"
    )
    assert choice_rule("place", "zebra", choices) == f"{rule}'zebra'"

"""The nearest right name."""

from serd_bag.nearest import choice_rule, hint


def test_the_nearest_name_is_offered_or_all_are():
    for slip in ("juncton", "JUNCTION"):
        assert hint(slip, ["hallway", "junction"]) == "did you mean 'junction'?"
    assert hint("zebra", ["junction", "hallway"]) == "choose from hallway, junction"
    assert hint("zebra", []) == "none is known"
    rule = "place must be one of hallway, junction, got "
    choices = ["hallway", "junction"]
    near = f"{rule}'junktion'; did you mean 'junction'?"
    assert choice_rule("place", "junktion", choices) == near
    assert choice_rule("place", "zebra", choices) == f"{rule}'zebra'"

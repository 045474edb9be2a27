"""The nearest right name."""

from storage.nearest import hint, nearest_name


def test_a_slip_finds_the_name_meant():
    assert nearest_name("hallwya", ["hallway", "junction"]) == "hallway"
    assert nearest_name("HALLWAY", ["hallway", "junction"]) == "hallway"


def test_nothing_near_is_none():
    assert nearest_name("zebra", ["hallway", "junction"]) is None
    assert nearest_name("zebra", []) is None


def test_the_hint_offers_the_nearest_or_all():
    assert hint("juncton", ["hallway", "junction"]) == "did you mean 'junction'?"
    assert hint("zebra", ["junction", "hallway"]) == "choose from hallway, junction"
    assert hint("zebra", []) == "none is known"

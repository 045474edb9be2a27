"""The data of the page: the layers of a learned model."""

import json
from dataclasses import replace

import numpy as np

from serd_app.navigation.overlay import ModelOverlay
from serd_app.teleop.page.view import overlay_message

NAN = float("nan")


def overlay(median_s, forward):
    return ModelOverlay(
        directions=np.array([[0, 1], [-1, 0], [0, 0]]),
        median_s=np.array(median_s),
        forward=np.array(forward),
        forward_by_model={"with_flow": 0.934, "against_flow": 0.5},
    )


def test_layers_have_a_number_and_a_shade_per_cell_and_none_where_there_is_no_value():
    layers = overlay_message(overlay([40.0, NAN, 0.0], [0.934, 0.5, NAN]))
    assert json.loads(json.dumps(layers, allow_nan=False)) == layers
    arrival, dynamics = layers["arrival"], layers["dynamics"]
    assert layers["policy"]["directions"] == [[0, 1], [-1, 0], [0, 0]]
    assert (arrival["labels"], arrival["shades"]) == (["40", "×", "0"], [1.0, None, 0.0])
    assert (arrival["low"], arrival["high"]) == ("0 s", "40 s")
    assert (dynamics["labels"], dynamics["shades"]) == (["93", "50", ""], [0.93, 0.5, None])
    assert dynamics["note"] == "all moves: with flow 93 %, against flow 50 %"


def test_a_model_by_which_no_drive_arrives_has_layers_too():
    arrival = overlay_message(overlay([NAN, NAN, NAN], [0.1, 0.1, NAN]))["arrival"]
    assert (arrival["labels"], arrival["shades"]) == (["×"] * 3, [None] * 3)
    assert arrival["high"] == "0 s"


def test_the_layers_state_what_is_driven_and_predicted_only_as_far_as_it_is_supported():
    trusted = overlay([40.0, 2.0, 0.0], [0.9, 0.5, NAN])
    layers = overlay_message(trusted)
    assert layers["arrival"]["title"].startswith("Predicted seconds")
    assert layers["policy"]["note"] == "dot: waits"
    doubted = replace(trusted, n_least_time=2, no_prediction_because=("one is few", "it is late"))
    layers = overlay_message(doubted)
    assert layers["arrival"]["title"].startswith("Computed seconds")
    assert layers["arrival"]["note"] == (
        "no prediction, because one is few, and because it is late"
    )
    assert layers["policy"]["note"].startswith("dot: waits; in 2 cells the way of least expected")

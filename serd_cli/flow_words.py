"""The flow told from recorded people, held against the scenario's own, in words and as values."""

from typing import Any

import numpy as np

from serd_app.demonstrations.flow_field import FlowField
from serd_core.arrays import IntArray
from serd_core.grid.navigation import NO_FLOW


def flow_values(found: FlowField | None, own: IntArray | None) -> dict[str, int] | None:
    """Counts of cells; None where nobody was recorded. own: (S,) of the scenario, if any."""
    if found is None:
        return None
    known = found.flow != NO_FLOW
    values = {
        "n_cells": len(known),
        "n_known": int(known.sum()),
        "n_sightings": int(found.count.sum()),
    }
    if own is None:
        return values
    both = known & (own != NO_FLOW)
    return values | {
        "n_compared": int(both.sum()),
        "n_as_scenario": int((both & (found.flow == own)).sum()),
        "n_opposite": int((both & (np.abs(found.flow - own) == 2)).sum()),
    }


def flow_in_words(found: FlowField | None, own: IntArray | None) -> str:
    """One line."""
    values: dict[str, Any] | None = flow_values(found, own)
    if values is None:
        return "flow of people: none was recorded"
    line = (
        f"flow of people: known in {values['n_known']} of {values['n_cells']} cells"
        f" from {values['n_sightings']} sightings"
    )
    if own is None:
        return line
    return (
        f"{line}; {values['n_as_scenario']} of {values['n_compared']} as in the scenario,"
        f" {values['n_opposite']} opposite"
    )

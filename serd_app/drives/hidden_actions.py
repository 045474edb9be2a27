"""Drives whose actions are hidden: decisions every period, of which only the states are known."""

from dataclasses import replace

import numpy as np

from serd_app.drives.mapped_actions import decision_times
from serd_app.drives.recorded_drive import RecordedDrive
from serd_core.demonstrations.decisions import HIDDEN


def with_hidden_actions(drive: RecordedDrive, period_s: float) -> RecordedDrive:
    """The drive without its intents: a decision every period from the start of each episode."""
    time_s = decision_times(drive.episodes, period_s)
    hidden = np.full(len(time_s), HIDDEN, dtype=np.int64)
    return replace(drive, intent_time_s=time_s, intent_action=hidden, dropped={})

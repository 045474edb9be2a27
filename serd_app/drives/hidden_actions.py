"""Drives whose actions are hidden: decisions every period, of which only the states are known."""

from dataclasses import replace

from serd_app.drives.mapped_actions import hidden_intents
from serd_app.drives.recorded_drive import RecordedDrive


def with_hidden_actions(drive: RecordedDrive, period_s: float) -> RecordedDrive:
    """The drive without its intents: a decision every period from the start of each episode."""
    found = hidden_intents(drive.episodes, period_s)
    return replace(drive, intent_time_s=found.time_s, intent_action=found.action, dropped={})

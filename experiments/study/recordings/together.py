"""Tables of decisions put together, episodes keeping their numbers."""

from collections.abc import Sequence

import numpy as np

from serd_core.demonstrations.decisions import Decisions


def together(tables: Sequence[Decisions]) -> Decisions:
    """All rows of several tables, one after the other.

    Episode numbers are kept, unlike in `serd_app.demonstrations.concatenate`: a seed and a number
    name an episode.
    """
    return Decisions(
        episode=np.concatenate([table.episode for table in tables]),
        time_s=np.concatenate([table.time_s for table in tables]),
        state=np.concatenate([table.state for table in tables]),
        action=np.concatenate([table.action for table in tables]),
        next_state=np.concatenate([table.next_state for table in tables]),
        source="; ".join(dict.fromkeys(table.source for table in tables)),
    )

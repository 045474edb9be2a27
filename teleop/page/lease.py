"""One driver at a time: the first page that speaks drives until it goes or is silent."""

SILENCE_S = 2.0


class Lease:
    """Pages are known by number; times are seconds of one steady clock."""

    def __init__(self) -> None:
        self._holder: int | None = None
        self._heard_s = 0.0

    def holder(self, now_s: float) -> int | None:
        """Who drives now."""
        if self._holder is not None and now_s - self._heard_s > SILENCE_S:
            self._holder = None
        return self._holder

    def claim(self, page: int, now_s: float) -> bool:
        """A page wants to drive: whether it may. The lease is kept by claiming again."""
        if self.holder(now_s) not in (None, page):
            return False
        self._holder, self._heard_s = page, now_s
        return True

    def release(self, page: int) -> bool:
        """A page has gone; whether it was the driver."""
        held = self._holder == page
        if held:
            self._holder = None
        return held

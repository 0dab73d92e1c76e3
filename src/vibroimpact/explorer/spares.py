"""Pages made ahead, and everything warmed up, so that a tab opens at once."""

from __future__ import annotations

import threading
from concurrent.futures import Future, ThreadPoolExecutor

from vibroimpact.explorer.page import Page
from vibroimpact.explorer.point import compute_point
from vibroimpact.explorer.pool import Pool
from vibroimpact.explorer.state import View


class Spares:
    """One page ready, and another one made whenever it is taken.

    Parameters
    ----------
    pool : Pool
        The threads that compute for the pages.
    """

    def __init__(self, pool: Pool) -> None:
        self._pool = pool
        self._maker = ThreadPoolExecutor(1, thread_name_prefix="explorer-spare")
        self._lock = threading.Lock()
        compute_point(View())  # compiles or loads what the first click needs
        self._next: Future[Page] = self._maker.submit(Page, pool)

    def take(self) -> Page:
        """Return a page that no tab has."""
        with self._lock:
            page = self._next
            self._next = self._maker.submit(self._make)
        return page.result()

    def _make(self) -> Page:
        threading.Event().wait(0.5)  # the tab that just opened comes first
        return Page(self._pool)

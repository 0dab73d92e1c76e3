"""How many workers a cluster has, as they come and go."""

from __future__ import annotations

import time
import warnings
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from distributed import Client

INTERVAL = 1.0  # seconds between two counts
LONELY = 20.0  # seconds without a worker after which the user is told


class Census:
    """The threads of all workers, counted now and then; tells the user where there are none."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self._number = 0
        self._counted = -INTERVAL
        self._empty_since: float | None = None
        self._told = False

    def threads(self) -> int:
        """Return how many threads there are, give or take a second."""
        now = time.monotonic()
        if now - self._counted >= INTERVAL:
            if self.client.status == "running":
                with suppress(OSError):  # the connection may be lost for a moment
                    self._number = sum(self.client.nthreads().values())
            self._counted = now
            self._tell(now)
        return self._number

    def _tell(self, now: float) -> None:
        """Warn once each time the last worker has been gone for long."""
        if self._number:
            self._empty_since, self._told = None, False
        elif self._empty_since is None:
            self._empty_since = now
        elif now - self._empty_since > LONELY and not self._told:
            self._told = True
            address = getattr(self.client.scheduler, "address", "ADDRESS")
            warnings.warn(
                f"`cluster` has no worker; the sweep waits for one: start it with `dask worker {address}`", stacklevel=2
            )

"""What is to be done, and how much of it travels together: cheap tasks share the price of a journey."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable
from statistics import fmean

# A journey takes client, scheduler and worker some 5 ms of processor time, half of it at the one scheduler.
WORTH = 0.1  # seconds of computing for which that is a small price
WORTH_A_THREAD = 0.005  # and at least as many as let the scheduler serve all threads in turn
MOST = 32  # tasks: what is computed waits until the parcel is
CUT = 9  # parcels a thread into which what is left is cut at least, so that all threads end together
REMEMBERED = 8  # parcels by whose pace the next ones are filled


class Waiting:
    """Numbers that wait to be done, handed out in parcels; the first, the last and the unlucky ones travel alone."""

    def __init__(self, numbers: Iterable[int]) -> None:
        self.losses: Counter[int] = Counter()
        self._numbers = deque(numbers)
        self._pace: deque[float] = deque(maxlen=REMEMBERED)

    def __len__(self) -> int:
        return len(self._numbers)

    def take(self, threads: int) -> tuple[int, ...]:
        """Return the numbers that travel next, where so many threads are at work."""
        parcel = [self._numbers.popleft()]
        size = self._size(threads)
        while len(parcel) < size and not self.losses[parcel[0]] and not self.losses[self._numbers[0]]:
            parcel.append(self._numbers.popleft())
        return tuple(parcel)

    def _size(self, threads: int) -> int:
        if not self._pace:
            return 1
        worth = max(WORTH, WORTH_A_THREAD * threads) / max(fmean(self._pace), 1e-6)
        return int(min(worth, MOST, len(self._numbers) / (CUT * threads)))

    def learn(self, seconds: float, tasks: int) -> None:
        """Note how long a worker took for a parcel."""
        self._pace.append(seconds / tasks)

    def put_back(self, parcel: Iterable[int]) -> None:
        """Take back numbers that were lost on the way."""
        for number in parcel:
            self.losses[number] += 1
            self._numbers.append(number)

    def clear(self) -> None:
        """Forget what waits."""
        self._numbers.clear()

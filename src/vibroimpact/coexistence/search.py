"""The attractors of an oscillator."""

from __future__ import annotations

from collections.abc import Iterable
from threading import Event

from vibroimpact.backends import get_backend
from vibroimpact.backends.base import Backend
from vibroimpact.coexistence.attractor import Attractor
from vibroimpact.coexistence.matching import match
from vibroimpact.coexistence.settling import NEEDED, Runner, Settled, rounds, settle
from vibroimpact.coexistence.starts import spread_cells, state_cells
from vibroimpact.execution.threads import worker_count
from vibroimpact.options import Sampling, Tolerances
from vibroimpact.oscillator import ImpactOscillator, State
from vibroimpact.progress import Report, reporter

SPREAD = 256  # starts where none are given


def attractors(
    osc: ImpactOscillator,
    starts: Iterable[State] | None = None,
    *,
    transient_impacts: int = 100,
    sample_impacts: int = 500,
    backend: str = "cpu",
    tolerances: Tolerances | None = None,
    workers: int | None = None,
    progress: bool | Report = False,
) -> list[Attractor]:
    r"""Return the attractors that starts lead to: the motions that coexist.

    Two cycles are one attractor if, from some impact of either on, :math:`|I_i - I'_i|` and
    :math:`|I_i e^{2\pi i\psi_i} - I'_i e^{2\pi i\psi'_i}|` are at most :math:`10^{-6} V` for all i.

    Parameters
    ----------
    osc : ImpactOscillator
        The seven numbers.
    starts : list of State, optional
        Where to start. None: 256 impacts, the same at every call, spread evenly over phases 0 to 1 and velocities 0 to
        4 V, V = max(f, k |g|)/sqrt(k m).
    transient_impacts, sample_impacts : int, >= 0 and >= 1
        Impacts left out, then kept, in the first of three rounds; starts that are then not decided go on to a
        second and a third one, four and sixteen times as long.
    backend : {"cpu", "cuda", "reference"}
        Who computes.
    tolerances : Tolerances, optional
        How small is small.
    workers : int, optional
        Threads; None is one a core. The result does not depend on it.
    progress : bool or callable
        True shows a bar; a callable gets (starts decided, starts in all, their `status` so far) and stops by returning
        False: what the starts decided by then lead to is returned.

    Returns
    -------
    list of Attractor
        The one with the largest share of starts first. Shares sum to 1 if every start was decided; the list is empty
        if none was.

    Raises
    ------
    ValueError
        A start is no `State` or lies beyond the stop, or another argument is out of its range.

    Notes
    -----
    A start is decided once its cycle is certain (stable, and within 1e-10 V), once it is certain never to hit again,
    or if it is chaotic: neighbours part by more than e^20 within the sample of the last round. All motions that stick
    are one attractor, as every release is the same state. Two chaotic motions are one if more than half of their
    impacts fall into the same boxes of a 64 x 64 grid on the impact surface. With r = 1 and c = 0 areas are kept and
    nothing attracts: starts stay undecided unless they never hit. With c = 0 alone, that a start never hits again often
    cannot be proved: it is undecided. Chaos that outlasts the last round is told as chaos even if it is a transient.
    Attractors that no start leads to are not found.
    Milliseconds where motions are regular, a second where they are chaotic.

    Examples
    --------
    >>> [(found.name, round(found.share, 2)) for found in attractors(ImpactOscillator(omega=1.45))]
    [('period-1 impact-1', 0.86), ('period-3 impact-4', 0.14)]
    """
    cells = spread_cells(osc, SPREAD) if starts is None else state_cells(osc, starts)
    sampling = Sampling(transient_impacts=transient_impacts, sample_impacts=sample_impacts)
    windows = rounds(osc, sampling.transient_impacts, sampling.sample_impacts)
    runner = Runner(osc, naming_backend(backend), tolerances or Tolerances(), worker_count(workers), Event())
    with reporter(progress, "starts") as tell:

        def report(settled: Settled, undecided: int) -> None:
            stopped = runner.stop.is_set()  # what had ended by then still comes in
            if not stopped and tell(len(cells) - undecided, len(cells), settled.status) is False:
                runner.stop.set()

        settled = settle(runner, cells, windows, report=report)
    return [basin.attractor for basin in match(runner, cells, settled, windows[-1])]


def naming_backend(name: str) -> Backend:
    """Return the back end of that name, if it can name cycles."""
    engine = get_backend(name)
    if not engine.tells.issuperset(NEEDED):
        raise ValueError(
            f"`backend` is {name!r}, which cannot name cycles; allowed are 'cpu', 'cuda' and 'reference'; choose 'cpu'"
        )
    return engine

"""The figures of each kind of result: the table that plotting and the command line read, without Matplotlib."""

from __future__ import annotations

from typing import Any, NamedTuple

from vibroimpact.parameters import Parameter, invalid

INCHES, DOTS = (0.5, 100.0), (10.0, 2400.0)  # of a side, and an inch
EXPONENTS = ("lyapunov", "lyapunov_per_impact")
MOTION = "motion"  # in place of an index: the types of motion


class Kind(NamedTuple):
    """A kind of figure: its function in `vibroimpact.plotting`, and the results it shows.

    `axes` is the number of axes of a parameter_map, and `needs` names the indices that it must hold; a `bundled` figure
    draws all parts of one dataset.
    """

    function: str
    results: tuple[str, ...]
    axes: int = 0
    needs: tuple[str, ...] = ()
    bundled: bool = False


# By the name that --figure takes. Of several for one result the first is the default.
# To add a figure: its function in plotting/, its name in plotting/__init__.py, its entry here.
KINDS = {
    "time-history": Kind("time_history", ("simulate",)),
    "phase-portrait": Kind("phase_portrait", ("simulate",)),
    "stroboscopic-map": Kind("stroboscopic_map", ("stroboscopic_section",)),
    "impact-map": Kind("impact_map", ("impact_section",)),
    "impact-histogram": Kind("impact_histogram", ("impact_statistics",)),
    "bifurcation-diagram": Kind("bifurcation_diagram", ("bifurcation_diagram",)),
    "index-curve": Kind("index_curve", ("parameter_map",), axes=1),
    "index-contour": Kind("index_contour", ("parameter_map",), axes=2),
    "index-surface": Kind("index_surface", ("parameter_map",), axes=2),
    "motion-map": Kind(
        "motion_map", ("parameter_map", "classify"), axes=2, needs=("lyapunov_per_impact", "n_periods", "n_impacts")
    ),
    "exponent-map": Kind("exponent_map", ("parameter_map",), axes=2, needs=("lyapunov",)),
    "index-scatter": Kind("index_scatter", ("parameter_map",)),
    "branch-diagram": Kind("branch_diagram", ("continue_orbit",), bundled=True),
    "response-curve": Kind("response_curve", ("response_curve",)),
    "boundaries": Kind("boundaries", ("boundary_curves", "continue_boundary"), bundled=True),
    "basin-portrait": Kind("basin_portrait", ("basins",)),
    "comparison": Kind("comparison_figure", ("compare",)),
}


def kinds_of(function: str, axes: int = 0) -> tuple[str, ...]:
    """Return the kinds of figure that show the result of a public function; for a map, with this number of axes.

    Examples
    --------
    >>> kinds_of("simulate"), kinds_of("parameter_map", 1)
    (('time-history', 'phase-portrait'), ('index-curve',))
    """
    of_map = function == "parameter_map"
    return tuple(name for name, kind in KINDS.items() if function in kind.results and (kind.axes == axes or not of_map))


def kind_of_index(index: str) -> str:
    """Return the kind of figure that shows an index over two parameters, or the types of motion.

    Examples
    --------
    >>> kind_of_index("std"), kind_of_index("lyapunov"), kind_of_index(MOTION)
    ('index-contour', 'exponent-map', 'motion-map')
    """
    return "motion-map" if index == MOTION else "exponent-map" if index in EXPONENTS else "index-contour"


def check_size(size: Any) -> tuple[float, float]:
    """Return the width and the height of a figure in inches, or refuse them.

    Examples
    --------
    >>> check_size((8, 0))
    Traceback (most recent call last):
    ValueError: `size` must be a width and a height, each 0.5 to 100 inches, got (8, 0); (8, 5) is usual
    """
    side = Parameter("size", "", low=INCHES[0], high=INCHES[1])
    try:
        width, height = map(side.check, size)
    except (TypeError, ValueError):
        allowed = "a width and a height, each {:g} to {:g} inches".format(*INCHES)
        raise invalid("size", size, allowed, "(8, 5) is usual") from None
    return width, height


def check_dpi(dpi: Any) -> float:
    """Return the dots per inch of a figure, or refuse them.

    Examples
    --------
    >>> check_dpi(1e-320)
    Traceback (most recent call last):
    ValueError: `dpi` must be between 10 and 2400, got 1e-320; 150 is usual
    """
    return Parameter("dpi", "dots per inch", low=DOTS[0], high=DOTS[1], hint="150 is usual").check(dpi)

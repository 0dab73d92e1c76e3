"""Every kind of figure can be read, for the paper's oscillator, a tube in SI units and a plane of tiny numbers.

No text meets another or leaves the figure, no tick label is there twice, what has a unit shows it, every colour and
hatch is explained by a legend, a colour bar or the only label of its axes, and no two entries of a legend look alike.
"""

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.collections import QuadMesh
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.path import Path
from matplotlib.transforms import Affine2D

import systems as make
import vibroimpact as vi
from designs import random_designs, shaker
from vibroimpact import figures, plotting
from vibroimpact.dataset import VARIABLES
from vibroimpact.indices import INDICES
from vibroimpact.plotting import style
from vibroimpact.plotting.continuation import COLORS
from vibroimpact.plotting.walls import STOPS

PAPER = vi.ImpactOscillator()
TUBE = vi.ImpactOscillator(
    mass=2.1, stiffness=26860, damping_ratio=0.01, amplitude=5, frequency=20, restitution=0.7, gap=0.5e-3
)
TINY = vi.ImpactOscillator(  # 2 mg, micrometres, 1 kHz
    mass=2e-6, stiffness=79.0, damping_ratio=0.005, amplitude=1.2e-5, frequency=980, restitution=0.8, gap=1e-6
)
# request: oscillator, the two axes of its plane, and the ends of a branch along the first
REQUESTS = {
    "paper": (PAPER, {"omega": np.linspace(0.5, 5.0, 24), "mass": np.linspace(0.1, 5.0, 16)}),
    "tube": (TUBE, {"omega": np.linspace(63.0, 251.0, 24), "gap": np.linspace(-0.4e-3, 0.9e-3, 16)}),
    "tiny": (TINY, {"mass": np.linspace(0.5e-6, 3.5e-6, 24), "gap": np.linspace(-0.5e-6, 2.1e-6, 16)}),
}
# Of pure numbers; a symbol alone, on the third axis of a surface, has its unit in the label of the colour bar.
PURE = tuple(long_name for long_name, units, _ in VARIABLES.values() if units == "1")


@cache
def sweep(request, kind):
    """Return a result of a request."""
    osc, axes = REQUESTS[request]
    (x, xs), (y, ys) = axes.items()
    scale, window = osc.velocity_scale, {"sample_impacts": 200}
    low = min(osc.gap, ys[0] if y == "gap" else osc.gap)
    several = [None, vi.State(low, -1.5 * scale), vi.State(low - scale / osc.natural_frequency, scale)]
    rng = np.random.default_rng(1)
    makers = {
        "motion": lambda: vi.simulate(osc, periods=12),
        "looks": lambda: vi.stroboscopic_section(osc, sample_periods=300),
        "hits": lambda: vi.impact_section(osc, sample_impacts=300),
        "diagram": lambda: vi.bifurcation_diagram(osc, sample_impacts=30, **{x: xs}),
        "heights": lambda: vi.bifurcation_diagram(osc, section="stroboscopic", sample_periods=30, **{y: ys}),
        "line": lambda: vi.parameter_map(osc, indices=tuple(INDICES), **window, **{x: xs}),
        "map": lambda: vi.parameter_map(osc, indices=tuple(INDICES), **window, **axes),
        "starts": lambda: vi.parameter_map(osc, indices=tuple(INDICES), start=several, **window, **axes),
        "designs": lambda: vi.parameter_map(
            osc,
            points={name: rng.uniform(at[0], at[-1], 40) for name, at in axes.items()},
            indices=("std", "lyapunov", "max_velocity", "n_periods"),
            start=3,
            **window,
        ),
        "basins": lambda: vi.basins(osc, phase=np.linspace(0, 1, 13), velocity=np.linspace(0, 3 * scale, 13)),
        "branch": lambda: vi.continue_orbit(vi.find_orbit(osc)[0], x, (xs[0], xs[-1])),
    }
    return makers[kind]()


def boundary_of(request):
    """Return the boundaries that begin in the special points of a branch."""
    branch, plane = sweep(request, "branch"), REQUESTS[request][1]
    box = [(values[0], values[-1]) for values in plane.values()]
    return [vi.continue_boundary(point, tuple(plane), tuple(box)) for point in branch.special[:2]]


def response_of(request):
    """Return the response curve of an oscillator around its natural frequency."""
    osc = REQUESTS[request][0]
    ends = 0.4 * osc.natural_frequency, 2.5 * osc.natural_frequency
    return vi.response_curve(osc, omega=ends, step=0.05)


FIGURES = {
    "time-history": lambda r: plotting.time_history(sweep(r, "motion")),
    "phase-portrait": lambda r: plotting.phase_portrait(sweep(r, "motion")),
    "stroboscopic-map": lambda r: plotting.stroboscopic_map(sweep(r, "looks")),
    "stroboscopic-map beside the stop": lambda r: plotting.stroboscopic_map(
        vi.stroboscopic_section(REQUESTS[r][0].replace(gap=0.0, omega=0.25 * REQUESTS[r][0].natural_frequency))
    ),
    "impact-map": lambda r: plotting.impact_map(sweep(r, "hits")),
    "impact-histogram": lambda r: plotting.impact_histogram(vi.impact_statistics(sweep(r, "hits"))),
    "bifurcation-diagram": lambda r: plotting.bifurcation_diagram(sweep(r, "diagram")),
    "bifurcation-diagram of displacements": lambda r: plotting.bifurcation_diagram(sweep(r, "heights")),
    "diagram with std": lambda r: plotting.diagram_with_index(sweep(r, "diagram"), sweep(r, "line")),
    "diagram with exponents": lambda r: plotting.diagram_with_index(sweep(r, "diagram"), sweep(r, "line"), "lyapunov"),
    "index-curve": lambda r: plotting.index_curve(sweep(r, "line")),
    "index-contour": lambda r: plotting.index_contour(sweep(r, "map")),
    "index-curve of starts": lambda r: plotting.index_curve(sweep(r, "starts").isel({list(REQUESTS[r][1])[1]: 9})),
    "index-contour of starts": lambda r: plotting.index_contour(sweep(r, "starts"), "max_velocity"),
    "motion-map of starts": lambda r: plotting.motion_map(sweep(r, "starts")),
    "numbers of starts": lambda r: plotting.index_contour(sweep(r, "starts"), "n_periods"),
    "index-surface": lambda r: plotting.index_surface(sweep(r, "map")),
    "index-surface of starts": lambda r: plotting.index_surface(sweep(r, "starts"), "max_velocity"),
    "motion-map": lambda r: plotting.motion_map(sweep(r, "map")),
    "exponent-map": lambda r: plotting.exponent_map(sweep(r, "map")),
    "index-scatter": lambda r: plotting.index_scatter(sweep(r, "designs")),
    "index-scatter of numbers": lambda r: plotting.index_scatter(sweep(r, "designs"), "n_periods"),
    "index-scatter of exponents": lambda r: plotting.index_scatter(sweep(r, "designs"), "lyapunov"),
    "basin-portrait": lambda r: plotting.basin_portrait(sweep(r, "basins")),
    "branch-diagram": lambda r: plotting.branch_diagram(sweep(r, "branch"), sweep(r, "diagram")),
    "boundaries": lambda r: plotting.boundaries(boundary_of(r), sweep(r, "map")),
    "boundaries over motions": lambda r: plotting.boundaries(boundary_of(r), ax=plotting.motion_map(sweep(r, "map"))),
    "response-curve": lambda r: plotting.response_curve(response_of(r)),
    "comparison": lambda r: plotting.comparison_figure([(osc := REQUESTS[r][0]), osc.replace(omega=1.1 * osc.omega)]),
    "sketch": lambda r: plotting.oscillator_sketch(REQUESTS[r][0]),
}


def test_every_kind_of_the_table_is_looked_at():
    assert {name.partition(" ")[0] for name in FIGURES} >= set(figures.KINDS)


def tick_labels(axis):
    """Return the tick labels drawn."""
    low, high = sorted(axis.get_view_interval())
    slack = 1e-9 * (high - low)
    return [
        tick.label1 if tick.label1.get_visible() else tick.label2
        for tick in axis.get_major_ticks()
        if low - slack <= tick.get_loc() <= high + slack
    ]


def legends_of(ax):
    return [part for part in ax.get_children() if isinstance(part, Legend)]


def axes_of(ax):
    """Return the axes that are drawn."""
    drawn = ax.axison or ax.name == "3d"
    return [getattr(ax, f"{name}axis") for name in ("x", "y", "z") if drawn and hasattr(ax, f"{name}axis")]


def texts_of(figure):
    """Yield every text that is drawn."""
    for ax in figure.axes:
        texts = [ax.title, ax._left_title, ax._right_title, *ax.texts]
        for axis in axes_of(ax):
            texts += [axis.label, axis.get_offset_text(), *tick_labels(axis)]
        for legend in legends_of(ax):
            texts += [*legend.get_texts(), legend.get_title()]
        yield from (text for text in texts if text.get_visible() and text.get_text().strip())


def box_of(text, margin=0.75):
    """Return the rectangle of a text, turned as the text is, less a margin in pixels."""
    angle, around = text.get_rotation(), text.get_window_extent()
    text.set_rotation(0.0)
    flat = text.get_window_extent()
    text.set_rotation(angle)
    half = np.array([flat.width, flat.height]) / 2.0 - margin
    centre = np.array([around.x0 + around.x1, around.y0 + around.y1]) / 2.0
    turn = Affine2D().rotate_deg(angle).translate(*centre)
    return Path(turn.transform(half * [(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]), closed=True)


def overlaps(figure):
    """Return the pairs of texts that meet."""
    boxes = [(text.get_text(), box_of(text)) for text in texts_of(figure)]
    return [(one, other) for (one, a), (other, b) in combinations(boxes, 2) if a.intersects_path(b, filled=True)]


def outside(figure):
    """Return the texts that leave the figure."""
    whole = figure.bbox.padded(1.0)
    return [
        text.get_text()
        for text in texts_of(figure)
        if not (whole.contains(*(box := text.get_window_extent()).p0) and whole.contains(*box.p1))
    ]


def repeated(figure):
    """Return the axes of which a tick label is there twice."""
    shown = {
        axis: [text.get_text() for text in tick_labels(axis) if text.get_text()]
        for ax in figure.axes
        for axis in axes_of(ax)
    }
    return [texts for texts in shown.values() if len(set(texts)) < len(texts)]


def without_unit(figure):
    """Return the labels of axes that show no unit though their quantity has one."""
    labels = [axis.label.get_text().replace("\n", " ") for ax in figure.axes for axis in axes_of(ax)]
    return [text for text in labels if text and "[" not in text and not text.startswith((*PURE, "$"))]


def unexplained(figure):
    """Return the colours and hatches in the axes that no legend, colour bar or text of their colour explains."""
    left = set()
    for ax in (ax for ax in figure.axes if ax.axison and ax.get_label() != "<colorbar>"):
        handles = [handle for legend in legends_of(ax) for handle in legend.legend_handles]
        beside = [other for other in figure.axes if other is not ax and other.bbox.bounds == ax.bbox.bounds]
        handles += [handle for other in beside for legend in legends_of(other) for handle in legend.legend_handles]
        known = {to_rgb(text.get_color()) for text in ax.texts}
        hatches = {"////"} if any("stop" in text.get_text() for text in ax.texts) else set()
        for handle in handles:
            hatches.add(getattr(handle, "get_hatch", lambda: None)())
            get = getattr(handle, "get_facecolor", None) or getattr(handle, "get_color", None)
            known |= {
                to_rgb(color) for color in (np.atleast_2d(get()) if get and not isinstance(get(), str) else [get()])
            }
        for mesh in ax.collections:
            if isinstance(mesh, QuadMesh) and mesh.colorbar is None:
                cells = np.asarray(mesh.get_array()).reshape(-1, np.asarray(mesh.get_array()).shape[-1])
                drawn = np.unique(cells[cells[:, 3] > 0.0, :3] if cells.shape[1] == 4 else cells, axis=0)
                left |= {tuple(color) for color in drawn if not any(np.allclose(color, other) for other in known)}
        lines = {to_rgb(line.get_color()) for line in ax.lines if isinstance(line, Line2D) and len(line.get_xdata())}
        lines -= {to_rgb("#555555"), to_rgb("#222222")}  # the stop, the line at zero, attractors: drawn in ink
        left |= lines - known if len(lines - known) > 1 else set()  # a single one is what the axes are labelled with
        left |= {patch.get_hatch() for patch in ax.patches} - hatches - {None}
    return left


def look_of(handle):
    """Return what a reader sees of an entry of a legend: colours, dashes, marker, hatch."""
    if isinstance(handle, Line2D):
        line = to_rgba(handle.get_color(), handle.get_alpha()) if handle.get_linestyle() != "None" else None
        dashes = tuple(handle._unscaled_dash_pattern[1] or ()) if line else None
        marker = handle.get_marker() if handle.get_marker() not in ("", "None", None) else None
        return "line", line, dashes, marker, to_rgba(handle.get_markerfacecolor()) if marker else None
    if hasattr(handle, "get_hatch") and hasattr(handle, "get_facecolor"):
        colors = [tuple(np.ravel(get())[:4]) for get in (handle.get_facecolor, handle.get_edgecolor)]
        return "patch", *colors, handle.get_hatch(), getattr(handle, "get_sizes", tuple)() is None
    return "other", id(handle)


def alike(figure):
    """Return the pairs of entries of one legend that look alike."""
    pairs = []
    for legend in (part for ax in figure.axes for part in legends_of(ax)):
        entries = [
            (text.get_text(), look_of(handle))
            for text, handle in zip(legend.get_texts(), legend.legend_handles, strict=True)
        ]
        pairs += [(one, other) for (one, a), (other, b) in combinations(entries, 2) if a == b]
    return pairs


def look_at(drawn):
    """Return what is wrong with a figure."""
    figure = drawn if hasattr(drawn, "axes") and isinstance(drawn.axes, list) else drawn.get_figure()
    figure.canvas.draw()
    faults = {
        check.__name__: found
        for check in (overlaps, outside, repeated, without_unit, unexplained, alike)
        if (found := check(figure))
    }
    plt.close(figure)
    return faults


@pytest.mark.long(but=4)
@pytest.mark.parametrize("request_", REQUESTS)
@pytest.mark.parametrize("kind", FIGURES)
def test_a_figure_can_be_read(kind, request_):
    assert look_at(FIGURES[kind](request_)) == {}


@pytest.mark.long(but=2)
@pytest.mark.parametrize(("index", "request_"), [*zip(INDICES, [*REQUESTS] * 4, strict=True)])
def test_the_figures_of_each_index_can_be_read(index, request_):
    assert look_at(plotting.index_curve(sweep(request_, "line"), index)) == {}
    assert look_at(plotting.index_contour(sweep(request_, "map"), index)) == {}


def planes():
    """Yield planes of one mass, in Hz and mm, of a family, and of a system, whose boundaries are many."""
    yield PAPER, ("restitution", "omega"), [(0.5, 0.9), (0.6, 3.0)]
    rng = np.random.default_rng(4)
    for osc in random_designs(rng, 3):
        yield osc, ("frequency", "gap"), [(0.6 * osc.frequency, 1.5 * osc.frequency), _around(osc)]
    yield shaker, ("rpm", "clearance_mm"), [(600.0, 2400.0), (0.1, 1.5)]
    yield make.one_mass(PAPER, stops=make.facing([1.0], 0.5, 0.6)), ("omega", "above_gap"), [(1.0, 3.0), (0.2, 0.9)]


def _around(osc):
    swing = osc.steady_amplitude
    return -0.5 * swing, 1.2 * swing


@pytest.mark.long(but=1)
@pytest.mark.parametrize("at", range(6))
def test_boundaries_of_any_design_differ_in_the_legend_and_are_named_in_the_plane_asked_for(at):
    """The colour shows the kind, the dashes the periods, and the impacts stand at the curve, inside the axes."""
    model, names, ranges = list(planes())[at]
    curves = vi.boundary_curves(model, names, ranges, n_periods=(1, 2, 3, 5), lines=4)
    assert len(curves) > 2
    drawn = plotting.boundaries(curves)
    texts, lines = drawn.texts, [line for line in drawn.lines if len(line.get_xdata()) > 1]
    figure = drawn.get_figure()
    figure.canvas.draw()
    frame = drawn.get_window_extent().padded(1.0)
    assert all(frame.contains(*corner) for text in texts for corner in text.get_window_extent().corners())
    types = {("no impact" if max(map(max, (o.velocities for o in c.orbits))) == 0.0 else _short(c)) for c in curves}
    assert types >= {text.get_text().partition(",")[0] for text in texts}
    assert len(texts) >= 0.7 * len(curves)
    for line, curve in zip(lines, curves, strict=False):
        np.testing.assert_array_equal(line.get_xydata(), curve.values)
    for axis, name in zip((drawn.xaxis, drawn.yaxis), names, strict=True):
        assert model.parameters[name].long_name in axis.label.get_text().replace("\n", " ")
    assert look_at(drawn) == {}


def _short(curve):
    n, p = curve.orbits[0].n_periods, curve.orbits[0].n_impacts
    return f"p{n} i{p}" if p > 0 else f"p{n} sticking"


def test_branches_of_many_types_and_impacts_on_many_stops_have_colours_of_their_own():
    colors = [style.color_at(palette, at) for palette in (COLORS, STOPS) for at in range(20)]
    for part in (colors[:20], colors[20:]):
        apart = [np.abs(np.subtract(to_rgb(a), to_rgb(b))).max() for a, b in combinations(part, 2)]
        assert min(apart) > 0.04


def test_a_small_quantity_is_shown_in_a_smaller_unit_and_its_data_stay_in_si():
    drawn = plotting.index_contour(sweep("tiny", "map"))
    assert (drawn.get_xlabel(), drawn.get_ylabel()) == ("mass $m$ [mg]", "gap $g$ [µm]")
    drawn.get_figure().canvas.draw()
    assert [text.get_text() for text in tick_labels(drawn.yaxis)][-1] == "2.0"
    assert drawn.get_ylim() == pytest.approx((-0.5e-6, 2.1e-6))
    assert "$g$ = 1 µm" in [text.get_text() for text in drawn.texts]
    plt.close("all")


def test_a_number_of_periods_has_a_colour_and_so_has_each_reason_for_none():
    """No impact and chaos, both 0, are told apart."""
    drawn = plotting.index_contour(sweep("tube", "map"), "n_periods")
    rows = [text.get_text().split("   ") for text in legends_of(drawn)[0].get_texts()]
    shares = {name: float(share.strip(" %")) for share, name in rows}
    assert {"1", "2", "no impact from rest", "permanently in contact", "chaotic"} <= set(shares)
    assert sum(shares.values()) == pytest.approx(100.0, abs=0.5)
    motions = vi.classify(sweep("tube", "map"))["motion"]
    assert shares["chaotic"] == pytest.approx(100.0 * float((motions == 4).mean()), abs=0.06)
    plt.close("all")


def test_cells_that_are_quiet_from_rest_alone_are_hatched_and_the_legend_says_so():
    several = sweep("tube", "starts")
    drawn = plotting.index_contour(several, "max_velocity")
    values = several["max_velocity"]
    quiet = np.isnan(values.isel(start=0)) & values.notnull().any("start")
    text = f"no impact from rest, impacts from other initial conditions ({int(quiet.sum())} cells)"
    assert quiet.any()
    assert text in [entry.get_text() for entry in drawn.get_legend().get_texts()]
    x, y = np.meshgrid(several["omega"], several["gap"], indexing="ij")
    inside = drawn.patches[0].get_path().contains_points(np.column_stack([x.ravel(), y.ravel()]))
    np.testing.assert_array_equal(inside.reshape(x.shape), quiet.transpose("omega", "gap"))
    shown = drawn.collections[0].get_array()
    np.testing.assert_allclose(shown.filled(np.nan), values.max("start").transpose("gap", "omega"))
    assert "worst of 3 initial conditions" in drawn.get_title()
    plt.close("all")


def test_the_package_lists_its_functions_alone():
    assert all(callable(getattr(plotting, name)) and name.islower() for name in dir(plotting))
    assert "index_contour" in dir(plotting)

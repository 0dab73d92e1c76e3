"""Maps of motions and exponents: each cell has its colour, the legend names what is shown, boundaries lie right."""

from collections import Counter
from itertools import combinations

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot as plt
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import vibroimpact as vi
from drawn import legend_texts, meshes
from vibroimpact.dataset import provenance, status_variable, variable
from vibroimpact.motion import MotionClass
from vibroimpact.motion.classes import motion_variable
from vibroimpact.plotting import boundaries, exponent_map, index_contour, motion_map
from vibroimpact.plotting.categories import COLORS, OPEN, OTHER_PERIODIC, PALETTE, USUAL, name_colors
from vibroimpact.plotting.motions import ATTRACTORS
from vibroimpact.plotting.style import BOUNDARY_COLORS, STATUS_COLORS, STICKING

OSC = vi.ImpactOscillator()
OMEGA, MASS = np.linspace(1.0, 3.0, 20), np.linspace(0.5, 2.5, 30)
LABELS = (r"angular driving frequency $\omega$ [rad/s]", "mass $m$ [kg]")


@pytest.fixture(scope="module")
def curves():
    return vi.boundary_curves(OSC, ("omega", "mass"), ((1.0, 3.0), (0.5, 2.5)), n_periods=(1, 2), lines=3)


def plane(**content):
    coords = {"omega": variable("omega", "omega", OMEGA), "mass": variable("mass", "mass", MASS)}
    return xr.Dataset(content, coords=coords, attrs=provenance("parameter_map", OSC, {"sample_impacts": 5000}))


def classes(rows):
    """Return a map whose columns of omega have the given (class, n_periods, n_impacts), the last one to the end."""
    motion, n, p = (np.empty((20, 30), int) for _ in range(3))
    for at, (kind, periods, impacts) in enumerate(rows):
        motion[at:], n[at:], p[at:] = kind, periods, impacts
    dims = ("omega", "mass")
    return plane(
        motion=motion_variable(dims, motion),
        n_periods=variable("n_periods", dims, n),
        n_impacts=variable("n_impacts", dims, p),
        status=status_variable(dims, np.zeros((20, 30), int)),
    )


def exponents(values, status=None):
    status = np.zeros((20, 30), int) if status is None else status
    return plane(
        lyapunov=variable("lyapunov", ("omega", "mass"), values), status=status_variable(("omega", "mass"), status)
    )


def with_statuses():
    """Return a map with cells of two statuses that have no value, whose legends are long."""
    status = np.zeros((20, 30), int)
    status[:3], status[3:6] = vi.Status.NO_IMPACT, vi.Status.STOPPED_IMPACTING
    values = np.where(status > 0, np.nan, 0.5)
    dims = ("omega", "mass")
    variables = {name: variable(name, dims, values) for name in ("std", "max_velocity")}
    return plane(**variables, status=status_variable(dims, status))


P, S, C, N, U = (MotionClass[name] for name in ("PERIODIC", "STICKING", "CHAOTIC", "NO_IMPACT", "UNDECIDED"))


def test_each_motion_has_its_colour_in_its_place_and_the_legend_its_share(ax):
    motion_map(
        classes([(S, 1, -1), (C, 0, 0), (N, 0, 0), (U, 0, 0), (P, 1, 1), (P, 1, 1), (P, 7, 9), (P, 2, 1)]), ax=ax
    )
    shade = meshes(ax)[0].get_array()
    assert shade.shape == (30, 20, 3)
    for column, color in enumerate(
        [STICKING, COLORS[C], COLORS[N], COLORS[U], USUAL[1, 1], USUAL[1, 1], PALETTE[-2], USUAL[2, 1]]
    ):
        np.testing.assert_allclose(shade[:, column], np.tile(to_rgb(color), (30, 1)))
    assert legend_texts(ax) == [
        "65.0 %   period-2 impact-1",
        "10.0 %   period-1 impact-1",
        "5.0 %   period-7 impact-9",
        "5.0 %   sticking",
        "5.0 %   chaotic",
        "5.0 %   no impact",
        "5.0 %   undecided",
    ]
    assert (ax.get_xlabel(), ax.get_ylabel()) == LABELS


def test_cells_whose_motion_depends_on_the_initial_condition_are_hatched_over_the_first_one(ax):
    one, two = classes([(P, 1, 1), (P, 1, 1)]), classes([(P, 1, 1), (P, 2, 1)])
    both = xr.concat([one, two], xr.Variable("start", [0, 1]), combine_attrs="override")
    motion_map(both.transpose("omega", "mass", "start"), ax=ax)
    (beside,) = (artist for artist in ax.artists if isinstance(artist, mpl.legend.Legend))
    assert [text.get_text().strip() for text in beside.get_texts()] == ["100.0 %   period-1 impact-1"]
    assert legend_texts(ax) == ["another motion from other initial conditions (570 cells)"]
    assert {patch.get_hatch() for patch in ax.patches} == {ax.get_legend().get_patches()[0].get_hatch()} != {None}
    shade = meshes(ax)[0].get_array()
    np.testing.assert_allclose(shade[:, 1], np.tile(to_rgb(USUAL[1, 1]), (30, 1)))


def test_rare_names_share_a_colour_and_shares_sum_to_all_cells(ax):
    names = [(P, n, p) for n in range(1, 13) for p in (1,)]
    motion_map(classes(names), ax=ax)
    shares = dict(text.split(" %   ")[::-1] for text in legend_texts(ax))
    assert len(shares) == len(PALETTE) + 1
    assert sum(map(float, shares.values())) == pytest.approx(100.0, abs=0.5)
    assert float(shares["other periodic"]) == pytest.approx(100 * 4 / 20)
    shade = meshes(ax)[0].get_array()
    assert (np.abs(shade - to_rgb(OTHER_PERIODIC)).max(axis=-1) < 1e-12).sum() == 4 * 30


def test_usual_names_keep_their_colours_and_no_two_names_share_one():
    counts = Counter({(9, 9): 50, (1, 1): 40, (8, 8): 30, (6, 6): 20, (5, 5): 15, (2, 1): 10, (7, 7): 1})
    chosen = name_colors(counts, 166)
    assert list(chosen)[:3] == [(9, 9), (1, 1), (8, 8)]
    assert (chosen[1, 1], chosen[2, 1]) == (USUAL[1, 1], USUAL[2, 1])
    assert len(set(chosen.values())) == len(chosen)


# Colours as seen without the long, the middle or the short cones: Machado, Oliveira and Fernandes (2009), table 1.
SIGHT = {
    "all cones": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}


def seen(color, sight):
    """Return a colour in CIE L*a*b* as the eye sees it."""
    rgb = np.array(to_rgb(color))
    light = np.clip(
        np.array(SIGHT[sight]) @ np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4), 0, 1
    )
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ light / np.array([0.9505, 1.0, 1.089])
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("sight", SIGHT)
def test_colours_stay_apart_for_colour_blind_readers(sight):
    motions = [*PALETTE, OTHER_PERIODIC, *COLORS.values()]
    lines = [color for color, _ in BOUNDARY_COLORS.values()]
    attractors = [*ATTRACTORS[:4], OPEN]
    for colors in (motions, lines, attractors):
        apart = [np.linalg.norm(seen(a, sight) - seen(b, sight)) for a, b in combinations(colors, 2)]
        assert min(apart) > 14.0  # neighbouring steps of a fine scale are 2 or 3 apart


def test_a_sweep_is_classified_on_the_way_to_its_map(ax):
    sweep = vi.parameter_map(
        OSC,
        omega=[0.1, 2.0, 2.8],
        gap=[0.0, 50.0],
        indices=("lyapunov_per_impact", "n_periods", "n_impacts"),
        sample_impacts=500,
    )
    motion_map(sweep, ax=ax)
    assert legend_texts(ax) == [
        "16.7 %   period-1 impact-1",
        "16.7 %   sticking",
        "16.7 %   chaotic",
        "50.0 %   no impact",
    ]


def test_maps_of_motions_refuse_other_results_with_the_way_out():
    row = classes([(P, 1, 1)]).isel(mass=0)
    with pytest.raises(ValueError, match="`sweep` must be a parameter_map over two axes, got 1 axis"):
        motion_map(row)
    with pytest.raises(ValueError, match="lacks lyapunov_per_impact, n_periods, n_impacts"):
        motion_map(vi.parameter_map(OSC, omega=[2.0, 3.0], mass=[1.0, 2.0], sample_impacts=50))
    with pytest.raises(ValueError, match="unknown `index` 'std'; choose from lyapunov, lyapunov_per_impact"):
        exponent_map(row, "std")
    with pytest.raises(ValueError, match="unknown `index` 'lyapunov'; choose from motion"):
        exponent_map(classes([(P, 1, 1)]))


def test_zero_is_the_middle_of_the_colours_whatever_the_exponents(ax):
    values = np.linspace(-0.3, 0.1, 600).reshape(20, 30)
    exponent_map(exponents(values), ax=ax)
    norm = meshes(ax)[0].norm
    assert norm(0.0) == 0.5
    assert -norm.vmin == norm.vmax == pytest.approx(np.percentile(np.abs(values), 99))
    assert (ax.get_xlabel(), ax.get_ylabel()) == LABELS
    assert ax.get_figure().axes[1].get_ylabel() == r"largest Lyapunov exponent $\lambda$ [1/s]"


def test_a_few_extreme_exponents_do_not_wash_out_the_others(ax):
    values = np.full((20, 30), -0.1)
    values[0, :3] = -40.0
    exponent_map(exponents(values), ax=ax)
    assert meshes(ax)[0].norm.vmax == pytest.approx(0.1)


def test_sticking_cells_have_a_colour_of_their_own_and_holes_their_status(ax):
    values, status = np.full((20, 30), -0.1), np.zeros((20, 30), int)
    values[:2], values[5, 7], status[5, 7] = -np.inf, np.nan, vi.Status.BUDGET
    exponent_map(exponents(values, status), ax=ax)
    finite, holes = meshes(ax)
    assert finite.get_array().mask.sum() == 61
    shade = holes.get_array()
    sticking = (shade[..., :3] == to_rgb(STICKING)).all(axis=-1)
    np.testing.assert_array_equal(sticking, np.isneginf(values.T))
    np.testing.assert_allclose(shade[7, 5], (*to_rgb(STATUS_COLORS[vi.Status.BUDGET]), 1.0))
    assert shade[..., 3].sum() == 61.0, "nothing but the hole is covered"
    assert legend_texts(ax) == ["not followed to the end (1 cell)", r"sticking: $\lambda$ = $-\infty$ (60 cells)"]


def test_exponents_of_cells_that_all_stick_still_draw(ax):
    exponent_map(exponents(np.full((20, 30), -np.inf)), ax=ax)
    ax.get_figure().draw_without_rendering()
    assert legend_texts(ax) == [r"sticking: $\lambda$ = $-\infty$ (600 cells)"]


@pytest.mark.long
def test_boundaries_are_drawn_point_by_point_and_named_by_kind_and_orbit(curves, ax):
    boundaries(curves, ax=ax)
    for line, curve in zip(ax.lines, curves, strict=True):
        np.testing.assert_array_equal(line.get_xydata(), curve.values)
        assert line.get_color() == BOUNDARY_COLORS[curve.kind][0]
    words = {curve.kind: curve.kind.replace("_", " ") for curve in curves} | {"end_of_sticking": "end"}
    expected = {f"{words[curve.kind]} of {curve.orbits[0].name}" for curve in curves}
    assert len(expected) >= 2
    assert sorted(legend_texts(ax)) == sorted(expected)
    assert (ax.get_xlabel(), ax.get_ylabel()) == LABELS
    assert "m$" not in ax.get_title(), "what varies has no place in the title"


@pytest.mark.long
def test_orbits_of_other_periods_have_other_dashes(curves, ax):
    boundaries(curves, ax=ax)
    dashes = {curve.orbits[0].n_periods: line.is_dashed() for curve, line in zip(curves, ax.lines, strict=True)}
    assert dashes == {1: False, 2: True}


@pytest.mark.long
def test_boundaries_lie_over_a_map_of_their_plane_in_either_order(curves):
    std = np.arange(600.0).reshape(20, 30)
    sweep = plane(
        std=variable("std", ("omega", "mass"), std),
        status=status_variable(("omega", "mass"), np.zeros((20, 30), int)),
    )
    turned = sweep.transpose("mass", "omega")
    first = curves[0]
    for drawn, columns in (
        (boundaries(curves, sweep, ax=Figure().add_subplot()), (0, 1)),
        (boundaries(first, turned, ax=Figure().add_subplot()), (1, 0)),
        (boundaries([first.dataset], ax=index_contour(turned, reference={}, ax=Figure().add_subplot())), (1, 0)),
    ):
        np.testing.assert_array_equal(drawn.lines[0].get_xydata(), first.values[:, columns])
        x = (OMEGA, MASS)[columns[0]]
        assert drawn.get_xlim() == (x[0], x[-1]), "the map keeps its limits"
        assert legend_texts(drawn)
    assert legend_texts(drawn)[0].startswith("boundary: $"), "the map's own legend is kept"


@pytest.mark.long
def test_a_map_beneath_boundaries_shows_no_lines_but_theirs(curves, ax):
    boundaries(curves, with_statuses(), "max_velocity", ax=ax)
    assert not [artist for artist in ax.collections if isinstance(artist, LineCollection)]
    assert not [text for text in legend_texts(ax) if text.startswith("boundary")]


@pytest.mark.long
@pytest.mark.parametrize("index", ["std", "max_velocity"])
def test_a_plane_keeps_its_room_above_a_legend_of_many_long_lines(curves, index):
    drawn = boundaries(curves, with_statuses(), index)
    figure = drawn.get_figure()
    figure.draw_without_rendering()
    plane, legend = drawn.get_position(), drawn.get_legend().get_window_extent()
    assert len(legend_texts(drawn)) >= 4
    assert plane.width > 0.6
    assert plane.height > 0.6
    assert 0.0 <= legend.x0 < legend.x1 <= figure.bbox.x1
    assert legend.y0 >= 0.0
    plt.close(figure)


def test_each_kind_of_curve_has_a_colour_of_its_own_and_a_halo_that_shows_where_it_does_not():
    """On any colour beneath, the line or its halo differs in lightness."""

    def lightness(color):
        return seen(color, "all cones")[0]

    colors = {color for color, _ in BOUNDARY_COLORS.values()}
    assert len(colors) == len(BOUNDARY_COLORS)
    assert "#ffffff" not in colors, "white are the lines of a level"
    for color, halo in BOUNDARY_COLORS.values():
        assert abs(lightness(color) - lightness(halo)) > 45.0


@pytest.mark.long
def test_the_legend_of_a_map_of_motions_stays_beside_it(curves, ax):
    boundaries(curves, ax=motion_map(classes([(P, 1, 1)]), ax=ax))
    assert all(" of period-" in text for text in legend_texts(ax))
    kept = [artist for artist in ax.artists if isinstance(artist, mpl.legend.Legend)]
    assert kept[0].get_texts()[0].get_text().endswith("period-1 impact-1")
    assert not kept[0].get_clip_on(), "it would be cut off outside the axes"


@pytest.mark.long
def test_period_one_loses_its_name_across_its_period_doubling(curves):
    """The curve is where the classes change: beyond it the orbit of period 1 is not seen."""
    doubling = next(c for c in curves if c.kind == "period_doubling" and c.orbits[0].n_periods == 1)
    omega, mass = doubling.values[len(doubling.orbits) // 2]
    orbit = doubling.orbits[len(doubling.orbits) // 2]
    names = set()
    for step in (-1e-3, 1e-3):
        sweep = vi.parameter_map(
            OSC.replace(mass=mass),
            omega=[omega + step],
            start=orbit.start,
            indices=("lyapunov_per_impact", "n_periods", "n_impacts"),
        )
        names.add((int(sweep["n_periods"][0]), int(sweep["n_impacts"][0])))
    assert (1, 1) in names
    assert len(names) == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (([],), "`curves` must hold at least one"),
        (([3.0],), "`curves` must be boundaries in a plane of two parameters, got a float"),
        ((classes([(P, 1, 1)]),), "got a result of parameter_map with motion, n_periods"),
    ],
)
def test_what_is_no_boundary_is_refused(arguments, words):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        boundaries(*arguments)
    assert words in str(caught.value)


@pytest.mark.long
def test_boundaries_of_another_plane_are_refused(curves, ax):
    other = curves[0].dataset.rename(mass="gap")
    other["gap"].attrs = variable("gap", (), 0.0).attrs
    with pytest.raises(ValueError, match="`curves` must lie in one plane, got omega and mass, omega and gap"):
        boundaries([curves[0], other])
    with pytest.raises(ValueError, match="`sweep` must run over omega and gap, as `curves` do, got omega and mass"):
        boundaries(other, classes([(P, 1, 1)]))
    motion_map(classes([(P, 1, 1)]), ax=ax)
    with pytest.raises(
        ValueError, match="`ax` must be new or show omega and gap, .* got axes of angular driving frequency"
    ):
        boundaries(other, ax=ax)

"""Maps of an index over two parameters: boundaries where the level is, nothing left without a reason."""

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
from vibroimpact import plotting
from vibroimpact.dataset import provenance, status_variable, variable
from vibroimpact.plotting.style import STATUS_COLORS

OMEGA, MASS = np.linspace(0.0, 2.0, 41), np.linspace(0.5, 2.5, 61)


def sweep(std, status=None, axes=("omega", "mass"), osc=None, name="std"):
    values = dict(zip(axes, (OMEGA, MASS), strict=False))
    status = np.zeros(np.shape(std), dtype=int) if status is None else status
    return xr.Dataset(
        {name: variable(name, axes, std), "status": status_variable(axes, status)},
        coords={axis: variable(axis, axis, data) for axis, data in values.items()},
        attrs=provenance("parameter_map", osc or vi.ImpactOscillator(), {}),
    )


def paraboloid(**kwargs):
    omega, mass = np.meshgrid(OMEGA, MASS, indexing="ij")
    return sweep((omega - 1.0) ** 2 + (mass - 1.5) ** 2, **kwargs)


def with_holes():
    """Return a map of ones, with two columns that never hit and three cells out of budget."""
    std, status = np.ones((41, 61)), np.zeros((41, 61), dtype=int)
    status[:2], status[-3:, 0] = vi.Status.NO_IMPACT, vi.Status.BUDGET
    std[status > 0] = np.nan
    return sweep(std, status)


def test_phases_have_colours_that_end_where_they_begin(ax):
    sweep = vi.parameter_map(
        vi.ImpactOscillator(), omega=[1.0, 2.0, 3.0], mass=[1.0, 2.0], indices=["harmonic_phase"], sample_impacts=50
    )
    plotting.index_contour(sweep, "harmonic_phase", ax=ax)
    mesh = meshes(ax)[0]
    assert (mesh.norm.vmin, mesh.norm.vmax) == (-np.pi, np.pi)
    assert np.allclose(mesh.cmap(0.0), mesh.cmap(1.0), atol=0.02)


def test_boundary_lines_lie_on_the_circle_where_a_paraboloid_has_its_level():
    (circle,) = plotting.boundary_lines(paraboloid(), "std", 0.25)
    assert circle.shape[1] == 2
    np.testing.assert_array_equal(circle[0], circle[-1])
    np.testing.assert_allclose(np.hypot(circle[:, 0] - 1.0, circle[:, 1] - 1.5), 0.5, atol=2e-3)


def test_boundary_lines_stay_out_of_cells_without_a_value():
    holes = paraboloid()
    holes["std"].values[OMEGA > 1.0] = np.nan
    lines = plotting.boundary_lines(holes, "std", 0.25)
    assert lines
    assert max(line[:, 0].max() for line in lines) <= 1.0 + 1e-12


def test_a_plateau_at_the_level_is_outlined_and_not_crossed_by_its_rounding():
    plateau = paraboloid()
    inside = plateau["std"].values < 0.25
    noise = 1e-14 * np.random.default_rng(4).normal(size=inside.shape)
    plateau["std"].values[...] = np.where(inside, 1.0 + noise, 0.5)
    (outline,) = plotting.boundary_lines(plateau, "std", 1.0)
    assert np.abs(np.hypot(outline[:, 0] - 1.0, outline[:, 1] - 1.5) - 0.5).max() < 0.1


def test_the_contour_draws_each_cell_at_its_place_with_the_first_axis_along_x(ax):
    plotting.index_contour(paraboloid(), ax=ax)
    mesh = meshes(ax)[0]
    assert mesh.get_array().shape == (61, 41)
    assert mesh.get_array()[60, 0] == pytest.approx(2.0)
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"angular driving frequency $\omega$ [rad/s]", "mass $m$ [kg]")
    label = ax.get_figure().axes[1].get_ylabel().replace("\n", " ")
    assert label == r"standard deviation of impact velocities ($\mathrm{Std}$) [m/s] (root scale)"


def test_the_contour_draws_the_boundary_at_the_level_asked_for_and_tells_it(ax):
    plotting.index_contour(paraboloid(), level=0.25, ax=ax)
    drawn = next(artist for artist in ax.collections if isinstance(artist, LineCollection))
    np.testing.assert_allclose(drawn.get_segments()[0], plotting.boundary_lines(paraboloid(), "std", 0.25)[0])
    assert legend_texts(ax) == [r"boundary: $\mathrm{Std}$ = 0.25 m/s"]


def test_the_default_level_is_a_twentieth_of_the_velocity_scale_for_std_and_others_have_no_boundary(ax):
    plotting.index_contour(paraboloid(osc=vi.ImpactOscillator(amplitude=4.0)), ax=ax)
    assert legend_texts(ax) == [r"boundary: $\mathrm{Std}$ = 0.2 m/s (5 % of the velocity scale)"]
    other = Figure().add_subplot()
    plotting.index_contour(paraboloid(name="max_velocity"), "max_velocity", ax=other)
    assert other.get_legend() is None
    assert not [artist for artist in other.collections if isinstance(artist, LineCollection)]
    plotting.index_contour(paraboloid(name="max_velocity"), "max_velocity", 0.5, ax=other)
    assert legend_texts(other) == [r"boundary: $\max\,I$ = 0.5 m/s"]


def test_the_scale_of_colours_says_that_it_goes_with_the_root(ax):
    plotting.index_contour(paraboloid(), ax=ax)
    bar, norm = ax.get_figure().axes[1], meshes(ax)[0].norm
    assert bar.get_ylabel().endswith("(root scale)")
    low, high = norm.vmin, norm.vmax
    assert norm(low + 0.25 * (high - low)) == pytest.approx(0.5)


def test_a_reference_value_is_a_labelled_line_across_the_map(ax):
    plotting.index_contour(paraboloid(), reference={"mass": 2.0, "omega": 0.5}, ax=ax)
    across, upright = (line.get_xydata() for line in ax.lines)
    np.testing.assert_array_equal(across[:, 1], [2.0, 2.0])
    np.testing.assert_array_equal(upright[:, 0], [0.5, 0.5])
    assert [text.get_text() for text in ax.texts] == ["$m$ = 2 kg", r"$\omega$ = 0.5 rad/s"]


def test_the_oscillators_own_value_is_marked_unless_it_is_off_the_map_or_unwanted():
    for osc, reference, lines in (
        (vi.ImpactOscillator(mass=1.0), None, 1),
        (vi.ImpactOscillator(mass=9.0), None, 0),
        (vi.ImpactOscillator(mass=1.0), {}, 0),
    ):
        ax = plotting.index_contour(paraboloid(osc=osc), reference=reference, ax=Figure().add_subplot())
        assert len(ax.lines) == lines


def test_cells_without_a_value_have_the_colour_of_their_status_and_the_legend_names_it(ax):
    plotting.index_contour(with_holes(), ax=ax)
    shade = meshes(ax)[1].get_array()
    np.testing.assert_allclose(shade[30, 1], (*to_rgb(STATUS_COLORS[vi.Status.NO_IMPACT]), 1.0))
    np.testing.assert_allclose(shade[0, 40], (*to_rgb(STATUS_COLORS[vi.Status.BUDGET]), 1.0))
    assert shade[30, 20, 3] == 0.0, "cells with a value stay uncovered"
    assert legend_texts(ax)[1:] == ["no impact (122 cells)", "not followed to the end (3 cells)"]


def test_a_map_without_any_value_still_draws_and_says_why(ax):
    empty = sweep(np.full((41, 61), np.nan), np.full((41, 61), vi.Status.STUCK_FOREVER))
    plotting.index_contour(empty, ax=ax)
    assert legend_texts(ax)[-1] == "permanently in contact (2501 cells)"
    ax.get_figure().draw_without_rendering()
    solid = Figure().add_subplot(projection="3d")
    plotting.index_surface(empty, ax=solid).get_figure().draw_without_rendering()


def test_the_surface_shows_every_cell_of_a_fine_map_and_lies_flat_where_there_is_no_value():
    solid = Figure().add_subplot(projection="3d")
    assert plotting.index_surface(paraboloid(), ax=solid) is solid
    solid.get_figure().draw_without_rendering()
    assert len(solid.collections[0].get_paths()) == 40 * 60, "matplotlib left alone thins to 50 x 50"
    holed = plotting.index_surface(with_holes(), ax=Figure().add_subplot(projection="3d"))
    holed.get_figure().draw_without_rendering()
    faces = holed.collections[0].get_facecolor()
    grey, red = (to_rgb(STATUS_COLORS[status]) for status in (vi.Status.NO_IMPACT, vi.Status.BUDGET))
    flat = [int((np.abs(faces[:, :3] - color) < 1e-9).all(axis=1).sum()) for color in (grey, red)]
    assert flat == [2 * 60, 3], "quadrangles with a corner in them"
    assert legend_texts(holed) == ["no impact (122 cells)", "not followed to the end (3 cells)"]


def test_maps_of_other_shapes_are_refused_with_the_way_out():
    cube = paraboloid().expand_dims(damping=[0.01, 0.02]).transpose("omega", "mass", "damping")
    line = paraboloid().isel(mass=3)
    for wrong, words in (
        (cube, "must be a parameter_map over two axes, got 3 axes (omega, mass, damping); select one value"),
        (cube, "sweep.sel(damping=0.01, method='nearest')"),
        (line, "got 1 axis (omega); draw it with index_curve"),
    ):
        for draw in (plotting.index_contour, plotting.index_surface):
            with pytest.raises(ValueError) as caught:  # noqa: PT011
                draw(wrong)
            assert words in str(caught.value)
    with pytest.raises(ValueError, match="`dataset` must be .* got one over 3 axes"):
        plotting.default_kind(cube)
    assert plotting.default_kind(paraboloid()) == "index-contour"


def from_starts():
    """Return the paraboloid from two initial conditions: the second is twice as high, and has no value at omega = 0."""
    one, two = paraboloid(), paraboloid()
    two["std"].values *= 2.0
    two["std"].values[0], two["status"].values[0] = np.nan, vi.Status.NO_IMPACT
    both = xr.concat([one, two], xr.Variable("start", [0, 1]), combine_attrs="override")
    return both.transpose("omega", "mass", "start")


def test_of_several_initial_conditions_the_largest_value_is_drawn_and_the_title_says_so():
    drawn = plotting.index_contour(from_starts())
    values = meshes(drawn)[0].get_array()
    one = paraboloid()["std"].values.T
    np.testing.assert_allclose(values[:, 1:], 2.0 * one[:, 1:])
    np.testing.assert_allclose(values[:, 0], one[:, 0])
    assert "worst of 2 initial conditions" in drawn.get_title().replace("\n", " ")
    plt.close(drawn.get_figure())
    line = plotting.index_curve(from_starts().isel(mass=0), ax=Figure().add_subplot()).lines[0]
    np.testing.assert_allclose(line.get_ydata()[1:], 2.0 * one[0, 1:])
    assert plotting.default_kind(from_starts()) == "index-contour"


def designs(**columns):
    cells = vi.parameter_map(vi.ImpactOscillator(), points=columns, sample_impacts=100)
    assert plotting.default_kind(cells) == "index-scatter"
    return cells


def test_scattered_designs_are_dots_over_their_first_two_parameters_coloured_by_the_index(ax):
    columns = {"omega": [1.9, 2.0, 2.1, 5.0], "mass": [1.0, 1.1, 0.9, 4.0], "gap": [0.0, 0.1, 0.2, 9.0]}
    found = designs(**columns)
    plotting.index_scatter(found, ax=ax)
    dots, crosses = ax.collections
    np.testing.assert_allclose(dots.get_offsets(), np.column_stack([columns["omega"], columns["mass"]])[:3])
    np.testing.assert_allclose(dots.get_array(), found["std"].values[:3])
    np.testing.assert_allclose(crosses.get_offsets(), [[5.0, 4.0]])
    assert legend_texts(ax)[0].endswith("(1 design)")
    assert (ax.get_xlabel(), ax.get_ylabel()) == (r"angular driving frequency $\omega$ [rad/s]", "mass $m$ [kg]")
    with pytest.raises(ValueError, match="index_scatter"):
        plotting.index_contour(found)
    with pytest.raises(ValueError, match="`designs` must be a parameter_map of scattered designs"):
        plotting.index_scatter(paraboloid())


def test_designs_of_one_parameter_have_the_index_along_y(ax):
    found = designs(omega=[1.9, 2.0, 2.1])
    plotting.index_scatter(found, ax=ax)
    np.testing.assert_allclose(ax.lines[0].get_xydata(), np.column_stack([found["omega"], found["std"]]))
    label = ax.get_ylabel().replace("\n", " ")
    assert label == r"standard deviation of impact velocities ($\mathrm{Std}$) [m/s]", "rounding has no unit of its own"


def test_a_family_is_drawn_over_its_own_parameters_with_their_units():
    @vi.family(units={"rpm": "1/min", "clearance_mm": "mm"})
    def shaker(rpm=20.0, clearance_mm=100.0, unbalance=0.5):
        omega = rpm * 2.0 * np.pi / 60.0
        return vi.ImpactOscillator(omega=omega, gap=clearance_mm / 1e3, amplitude=unbalance * omega**2)

    cells = vi.parameter_map(shaker, rpm=[18.0, 20.0, 22.0], clearance_mm=[50.0, 100.0, 150.0], sample_impacts=100)
    drawn = plotting.index_contour(cells)
    assert (drawn.get_xlabel(), drawn.get_ylabel()) == ("rpm [1/min]", "clearance mm [mm]")
    assert drawn.get_title() == "shaker,  unbalance = 0.5,  from rest"
    assert [text.get_text() for text in drawn.texts] == ["clearance_mm = 100 mm"]
    curve = plotting.index_curve(cells.sel(clearance_mm=150.0))
    assert curve.get_title() == "shaker,  clearance_mm = 150,  unbalance = 0.5,  from rest"
    pair = plotting.comparison_figure([shaker.replace(rpm=13.4), shaker.replace(rpm=26.7)], periods=2)
    assert [ax.get_title().splitlines()[1] for ax in pair.axes[:2]] == ["rpm = 13.4 1/min", "rpm = 26.7 1/min"]
    plt.close("all")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"index": "lyapunov"}, "unknown `index` 'lyapunov'; choose from std"),
        ({"level": "low"}, "`level` must be a finite number, got 'low'"),
        ({"level": np.inf}, "`level` must be a finite number, got inf"),
        ({"reference": {"gap": 0.0}}, "in `reference` 'gap'; choose from omega, mass"),
        ({"reference": {"mass": 7.0}}, "must be between 0.5 and 2.5, the range of the map, got 7.0"),
    ],
)
def test_wrong_arguments_of_the_contour_are_refused_in_words(arguments, words, ax):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        plotting.index_contour(paraboloid(), **arguments, ax=ax)
    assert words in str(caught.value)


def test_a_surface_on_flat_axes_is_refused(ax):
    with pytest.raises(ValueError, match="`ax` must be three-dimensional axes"):
        plotting.index_surface(paraboloid(), ax=ax)


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_a_figure_is_written_whole_the_same_each_time_and_keeps_its_own_size(ending, tmp_path):
    drawn = [plotting.index_contour(paraboloid(), ax=Figure().add_subplot()) for _ in "ab"]
    size = tuple(drawn[0].get_figure().get_size_inches())
    first, second = (
        plotting.save_figure(ax, tmp_path / f"{name}.{ending}", size=(3, 2), dpi=50)
        for name, ax in zip("ab", drawn, strict=True)
    )
    assert first.read_bytes() == second.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"a.{ending}", f"b.{ending}"]
    assert tuple(drawn[0].get_figure().get_size_inches()) == size
    if ending == "png":
        assert mpl.image.imread(first).shape[:2] == (100, 150)


def test_an_existing_figure_is_kept_unless_it_may_be_overwritten(tmp_path, ax):
    path = tmp_path / "figure.svg"
    path.write_text("mine")
    with pytest.raises(FileExistsError):
        plotting.save_figure(ax, path)
    assert path.read_text() == "mine"
    plotting.save_figure(ax, path, overwrite=True)
    assert "<svg" in path.read_text()


def test_a_figure_that_cannot_be_drawn_leaves_the_old_file_and_nothing_else(tmp_path, ax, monkeypatch):
    path = tmp_path / "figure.png"
    path.write_text("mine")

    def full_disk(part, **_):
        part.write_text("half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(ax.get_figure(), "savefig", full_disk)
    with pytest.raises(OSError, match="No space left"):
        plotting.save_figure(ax, path, overwrite=True)
    assert [p.read_text() for p in tmp_path.iterdir()] == ["mine"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"path": "figure.gif"}, r"must end in \.png, \.svg or \.pdf, got 'figure.gif'"),
        ({"path": "figure.png", "dpi": 0}, "`dpi` must be between 10 and 2400, got 0"),
        ({"path": "figure.png", "dpi": 1e-320}, "`dpi` must be between 10 and 2400, got 1e-320"),
        ({"path": "figure.png", "dpi": 2400, "size": (100, 100)}, "`dpi` makes 5.76e[+]10 pixels, which take"),
        ({"path": "figure.png", "size": 3}, "`size` must be a width and a height, each 0.5 to 100 inches, got 3"),
        (
            {"path": "figure.png", "size": (3, 0)},
            r"`size` must be a width and a height, each 0.5 to 100 inches, got \(3, 0\)",
        ),
    ],
)
def test_a_wrong_ending_size_or_resolution_is_refused(arguments, words, ax):
    with pytest.raises(ValueError, match=words):
        plotting.save_figure(ax, **arguments)

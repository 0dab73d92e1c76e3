"""Figures of orbits, sections and diagrams show what their Dataset holds, and say what they cannot show."""

import inspect
import json

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

import vibroimpact as vi
from drawn import legend_texts
from processes import python
from vibroimpact import figures, plotting
from vibroimpact.dataset import impact_speed, provenance, status_variable, variable

OSC = vi.ImpactOscillator(mass=2.0, omega=2.0, gap=0.5)


def bouncing(osc=OSC, stick=((0.3, np.nan),), status=vi.Status.OK):
    """Return a made-up motion that meets the stop at t = 1 and 3 with speeds 2 and 1.5."""
    time = np.linspace(0.0, 4.0, 41)
    displacement = osc.gap - np.abs(np.cos(np.pi / 2 * time))
    stick = np.array(stick, dtype=float).reshape(-1, 2)
    return xr.Dataset(
        {
            "displacement": variable("displacement", "time", displacement),
            "velocity": variable("velocity", "time", np.sin(time)),
            "impact_time": variable("impact_time", "impact", [1.0, 3.0]),
            "impact_velocity": variable("impact_velocity", "impact", [2.0, 1.5]),
            "stick_time": variable("stick_time", "stick", stick[:, 0]),
            "release_time": variable("release_time", "stick", stick[:, 1]),
            "status": status_variable((), status),
        },
        coords={"time": variable("time", "time", time)},
        attrs=provenance("simulate", osc, {}),
    )


def strobe(y, dy, osc=OSC, status=vi.Status.OK):
    data = {
        "displacement": variable("displacement", "period", y),
        "velocity": variable("velocity", "period", dy),
        "status": status_variable((), status),
    }
    return xr.Dataset(data, attrs=provenance("stroboscopic_section", osc, {}))


def impacts(phase, speed, stick=(), osc=OSC, status=vi.Status.OK):
    stick = np.array(stick, dtype=float).reshape(-1, 2)
    data = {
        "phase": variable("phase", "impact", phase),
        "velocity": impact_speed("impact", speed),
        "stick_time": variable("stick_time", "stick", stick[:, 0]),
        "release_time": variable("release_time", "stick", stick[:, 1]),
        "status": status_variable((), status),
    }
    return xr.Dataset(data, attrs=provenance("impact_section", osc, {}))


def diagram(velocity, status=None, axis="omega", dim="impact"):
    n = len(velocity)
    data = {
        "velocity": impact_speed((axis, dim), velocity),
        "status": status_variable(axis, [0] * n if status is None else status),
    }
    name = "phase" if dim == "impact" else "displacement"
    data[name] = variable(name, (axis, dim), np.asarray(velocity) / 10.0)
    coords = {axis: variable(axis, axis, np.linspace(1.0, 2.0, n))}
    return xr.Dataset(data, coords=coords, attrs=provenance("bifurcation_diagram", OSC, {}))


def curve(std, status=None, axis="omega"):
    n = len(std)
    data = {"std": variable("std", axis, std), "status": status_variable(axis, [0] * n if status is None else status)}
    coords = {axis: variable(axis, axis, np.linspace(1.0, 2.0, n))}
    return xr.Dataset(data, coords=coords, attrs=provenance("parameter_map", OSC, {}))


def line_named(ax, part):
    return next(line for line in ax.lines if part in str(line.get_label()))


def bars(ax, part):
    collection = next(c for c in ax.collections if isinstance(c, LineCollection) and part in str(c.get_label()))
    return np.array(collection.get_segments())


def test_interactive_mode_that_a_notebook_turns_on_with_its_first_figure_stays_on(monkeypatch):
    import matplotlib.pyplot as plt

    with mpl.rc_context({"interactive": False}):
        monkeypatch.setattr(plt, "draw_if_interactive", lambda: mpl.interactive(True))  # as a back end that is loaded
        plotting.time_history(bouncing())
        assert mpl.is_interactive()
    plt.close("all")


def test_the_time_history_reaches_the_stop_at_every_impact_and_shades_what_lies_behind(ax):
    assert plotting.time_history(bouncing(), ax) is ax
    x, y = ax.lines[0].get_data()
    assert {(1.0, 0.5), (3.0, 0.5)} <= set(zip(x, y, strict=True)), "impact instants are points of the line"
    wall = ax.patches[0].get_bbox()
    assert wall.y0 == OSC.gap
    assert wall.y1 == ax.get_ylim()[1]
    marks = line_named(ax, "2 impacts")
    np.testing.assert_array_equal(marks.get_xydata(), [[1.0, 0.5], [3.0, 0.5]])


def test_a_stick_is_a_bar_on_the_stop_and_lasts_to_the_end_if_not_released(ax):
    plotting.time_history(bouncing(stick=[(0.3, 0.6), (3.5, np.nan)]), ax)
    np.testing.assert_allclose(bars(ax, "2 sticks"), [[[0.3, 0.5], [0.6, 0.5]], [[3.5, 0.5], [4.0, 0.5]]])


def test_the_phase_portrait_breaks_the_line_at_impacts_and_joins_it_by_the_law_of_restitution(ax):
    plotting.phase_portrait(bouncing(), ax)
    y, dy = line_named(ax, "flight").get_data()
    breaks = np.flatnonzero(np.isnan(dy))
    assert len(breaks) == 2
    np.testing.assert_allclose(dy[breaks - 1], [2.0, 1.5])
    np.testing.assert_allclose(dy[breaks + 1], -OSC.restitution * np.array([2.0, 1.5]))
    np.testing.assert_allclose(y[breaks + 1], OSC.gap)
    np.testing.assert_allclose(bars(ax, "impacts"), [[[0.5, 2.0], [0.5, -1.6]], [[0.5, 1.5], [0.5, -1.2]]])


def test_a_sample_that_falls_on_an_impact_draws_no_loop_behind_the_stop(ax):
    osc = vi.ImpactOscillator(omega=2.0)
    start = vi.find_orbit(osc)[0].start  # at its impact, so that each hundredth sample falls on one
    plotting.phase_portrait(vi.simulate(osc, start=start, periods=5, samples_per_period=100), ax=ax)
    (flight,) = (line for line in ax.lines if line.get_label() == "flight")
    assert np.nanmax(flight.get_xdata()) < 1e-9


def test_few_samples_of_a_smooth_motion_draw_no_polygon(ax):
    time = np.linspace(0.0, 20.0, 61)  # every third of a radian
    motion = bouncing().isel(impact=slice(0, 0), stick=slice(0, 0)).drop_dims("time")
    motion = motion.assign(
        displacement=variable("displacement", "time", np.cos(time) - 1.0),
        velocity=variable("velocity", "time", -np.sin(time)),
    ).assign_coords(time=variable("time", "time", time))
    y, dy = line_named(plotting.phase_portrait(motion, ax), "flight").get_data()
    assert len(y) > 5 * len(time)
    np.testing.assert_allclose(np.hypot(y + 1.0, dy), 1.0, atol=2e-3)


@pytest.mark.parametrize("draw", [plotting.time_history, plotting.phase_portrait])
def test_a_stop_far_from_the_motion_is_told_but_does_not_flatten_it(draw, ax):
    motion = (
        bouncing().isel(impact=slice(0, 0), stick=slice(0, 0)).assign(status=status_variable((), vi.Status.NO_IMPACT))
    )
    motion.attrs = provenance("simulate", OSC.replace(gap=100.0), {})
    draw(motion, ax)
    assert max(ax.get_xlim()[1], ax.get_ylim()[1]) < 10.0
    assert "stop, $g$ = 100 m" in ax.texts[0].get_text()
    assert "never reaches the stop" in legend_texts(ax)[-1]


def test_a_periodic_orbit_is_one_large_mark_and_the_axes_do_not_zoom_into_its_rounding(ax):
    noise = 1e-13 * np.random.default_rng(1).normal(size=500)
    plotting.stroboscopic_map(strobe(-1.2 + noise, noise), ax)
    mark = line_named(ax, "1 point in 500 periods")
    assert len(mark.get_xdata()) == 1
    assert mark.get_markersize() >= 6
    assert np.ptp(ax.get_xlim()) >= 0.1 * 1.2
    assert np.ptp(ax.get_ylim()) >= 0.1 * OSC.velocity_scale, "velocities that are only rounding take the scale V"


def test_a_chaotic_attractor_is_drawn_point_by_point_and_counted(ax):
    rng = np.random.default_rng(2)
    section = strobe(rng.uniform(-1, 0, 5000), rng.normal(size=5000))
    plotting.stroboscopic_map(section, ax)
    dots = line_named(ax, "5000 periods")
    np.testing.assert_array_equal(dots.get_xdata(), section["displacement"])
    assert dots.get_markersize() < 3
    assert dots.get_alpha() < 1


def test_the_impact_map_spans_the_whole_period_and_counts_a_point_at_the_wrap_once(ax):
    phase = np.tile([1.0 - 1e-12, 1e-12, 0.25, 0.25], 50)
    plotting.impact_map(impacts(phase, np.tile([2.0, 2.0, 1.0, 1.0], 50)), ax)
    assert ax.get_xlim() == (0.0, 1.0)
    assert ax.get_ylim()[0] <= 0.0 < 2.0 < ax.get_ylim()[1]
    assert legend_texts(ax) == ["2 points in 200 impacts"]


def test_a_stick_lies_on_the_phase_axis_of_the_impact_map_and_wraps_with_the_period(ax):
    period = OSC.period
    plotting.impact_map(impacts([0.5], [1.0], stick=[(0.75 * period, 1.25 * period), (5.1 * period, np.nan)]), ax)
    np.testing.assert_allclose(bars(ax, "stick"), [[[0.75, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.25, 0.0]]], atol=1e-12)


@pytest.mark.parametrize(
    "empty", [impacts([], [], status=vi.Status.NO_IMPACT), strobe([], [], status=vi.Status.NO_IMPACT)]
)
def test_an_empty_section_says_why(empty, ax):
    (plotting.impact_map if "phase" in empty else plotting.stroboscopic_map)(empty, ax)
    assert "never reaches the stop" in ax.texts[0].get_text()


def test_a_bifurcation_diagram_draws_every_sample_and_names_empty_columns(ax):
    velocity = [[1.0, 2.0, np.nan], [1.5, np.nan, np.nan], [np.nan] * 3, [np.nan] * 3]
    plotting.bifurcation_diagram(diagram(velocity, [0, 1, vi.Status.NO_IMPACT, vi.Status.BUDGET]), ax=ax)
    dots = ax.lines[0]
    np.testing.assert_allclose(dots.get_xydata(), [[1.0, 1.0], [1.0, 2.0], [4 / 3, 1.5]])
    assert dots.get_rasterized()
    assert legend_texts(ax)[1:] == ["no impact (1 column)", "not followed to the end (1 column)"]
    np.testing.assert_allclose(line_named(ax, "no impact").get_xdata(), [5 / 3])
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        r"angular driving frequency $\omega$ [rad/s]",
        "impact velocity $I$ [m/s]",
    )


def test_a_bifurcation_diagram_shows_the_quantity_asked_for(ax):
    plotting.bifurcation_diagram(diagram([[1.0], [2.0]]), quantity="phase", ax=ax)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), [0.1, 0.2])
    looks = plotting.bifurcation_diagram(diagram([[1.0], [2.0]], dim="period"), ax=Figure().add_subplot())
    assert looks.get_ylabel() == "displacement $y$ [m]"


def test_a_title_tells_the_angular_frequency_in_hertz_too():
    """w = 2 pi 20 Hz."""
    line = curve([0.1, 0.2], axis="mass").assign_attrs(
        provenance("parameter_map", vi.ImpactOscillator(frequency=20.0), {})
    )
    title = plotting.index_curve(line).get_title().replace("\n", " ")
    assert r"$\omega$ = 125.66 rad/s (20 Hz)" in title
    assert "Hz" not in plotting.index_curve(curve([0.1, 0.2])).get_title(), "what is swept is not told"


def test_thinning_a_large_diagram_keeps_every_branch_and_draws_true_samples(ax):
    velocity = np.tile(np.arange(1.0, 8.0), (60, 800))  # period-7 in each of 60 columns, 336,000 samples
    chaos = np.random.default_rng(3).uniform(0.0, 9.0, velocity.shape[1])
    velocity[30] = chaos
    plotting.bifurcation_diagram(diagram(velocity), ax=ax)
    x, y = ax.lines[0].get_data()
    assert len(y) < 5000
    assert set(y[x == 1.0]) == set(range(1, 8))
    column = y[np.isclose(x, 1.0 + 30 / 59)]
    assert set(column) <= set(chaos)
    assert np.abs(np.sort(column)[None, :] - chaos[:, None]).min(axis=1).max() <= 9.0 / 2000


def test_the_index_stands_on_top_of_the_diagram_at_its_scale(ax):
    plotting.diagram_with_index(diagram([[1.0, 2.0], [3.0, 3.5]]), curve([0.5, 2.0, 0.25]), ax=ax)
    line = line_named(ax, "Std")
    np.testing.assert_allclose(line.get_xydata(), [[1.0, 2.5], [1.5, 10.0], [2.0, 1.25]])
    assert legend_texts(ax)[-1] == r"5 $\times$ $\mathrm{Std}$"
    assert ax.get_ylim()[1] > 10.0
    assert ax.get_figure().axes == [ax], "both are velocities"


def test_an_index_that_is_no_velocity_stands_on_an_axis_of_its_own_with_its_unit(ax):
    exponent = curve([-0.5, 0.25, -np.inf]).rename(std="lyapunov")
    exponent["lyapunov"].attrs = variable("lyapunov", (), 0.0).attrs
    speeds = diagram([[1.0, 2.0], [3.0, 3.5]])
    plotting.diagram_with_index(speeds, exponent, index="lyapunov", ax=ax)
    (right,) = (other for other in ax.get_figure().axes if other is not ax)
    assert right.get_ylabel() == r"largest Lyapunov exponent $\lambda$ [1/s]"
    np.testing.assert_array_equal(right.lines[0].get_ydata(), [-0.5, 0.25, -np.inf])
    assert right.get_ylim()[0] < -0.5 < 0.25 < right.get_ylim()[1]
    assert legend_texts(ax)[-1] == r"$\lambda$", "the factor of five is the paper's for Std"
    alone = plotting.bifurcation_diagram(speeds, ax=Figure().add_subplot())
    assert ax.get_ylim() == alone.get_ylim(), "the axis of velocities shows velocities"


def test_an_index_curve_breaks_where_there_is_no_value_and_says_why(ax):
    status = [0, vi.Status.STOPPED_IMPACTING, 0]
    plotting.index_curve(curve([0.1, np.nan, 0.3], status), ax=ax)
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), [0.1, np.nan, 0.3])
    np.testing.assert_array_equal(ax.lines[1].get_ydata(), [0.1, 0.3])
    assert legend_texts(ax) == ["impacts cease after a transient (1 column)"]


def test_a_negative_exponent_is_drawn_whole_with_a_line_at_zero(ax):
    omega = np.array([1.4, 2.0, 2.8])
    sweep = vi.parameter_map(vi.ImpactOscillator(), omega=omega, indices=["lyapunov"], sample_impacts=300)
    plotting.index_curve(sweep, "lyapunov", ax=ax)
    assert ax.get_ylim()[0] < float(sweep["lyapunov"].min()) < 0.0 < float(sweep["lyapunov"].max()) < ax.get_ylim()[1]
    assert any(len(set(line.get_ydata())) == 1 for line in ax.lines)


def test_a_missing_label_falls_back_on_the_table_and_a_pure_number_has_no_unit(ax):
    bare = curve([0.1, 0.2])
    for name in ("omega", "std"):
        bare[name].attrs = {}
    plotting.index_curve(bare, ax=ax)
    assert ax.get_ylabel().replace("\n", " ") == r"standard deviation of impact velocities ($\mathrm{Std}$) [m/s]"
    bare["std"].attrs["units"] = "1"
    assert "[" not in plotting.index_curve(bare, ax=Figure().add_subplot()).get_ylabel()


@pytest.mark.parametrize("name", [name for name in plotting.__all__ if name[0].islower()])
def test_the_help_of_a_figure_has_every_parameter_and_what_it_returns(name):
    figure = getattr(plotting, name)
    text = inspect.getdoc(figure)
    assert [line for line in inspect.signature(figure).parameters if f"\n{line} : " not in text] == []
    order = [
        text.find(f"\n{head}\n---") for head in ("Parameters", "Returns", "Raises", "Notes", "References", "Examples")
    ]
    assert order[1] > 0
    assert [at for at in order if at > 0] == sorted(at for at in order if at > 0)


@pytest.mark.parametrize(
    ("draw", "wrong", "words"),
    [
        (plotting.time_history, impacts([0.5], [1.0]), "`simulation` must be a result of simulate"),
        (plotting.phase_portrait, [1.0, 2.0], "got a list; pass what vibroimpact.simulate returns"),
        (plotting.stroboscopic_map, impacts([0.5], [1.0]), "pass what vibroimpact.stroboscopic_section returns"),
        (plotting.impact_map, strobe([0.5], [1.0]), "must be a result of impact_section"),
        (plotting.oscillator_sketch, 3, "`oscillator` must be an ImpactOscillator or a family, got an int"),
        (plotting.oscillator_sketch, vi.models.impact_damper(), "an ImpactOscillator or a family, got an ImpactSystem"),
        (plotting.impact_histogram, strobe([0.5], [1.0]), "must be a result of impact_statistics"),
        (plotting.bifurcation_diagram, curve([0.1, 0.2]), "got a result of parameter_map with std"),
        (
            plotting.index_curve,
            diagram([[1.0], [2.0]]),
            "`sweep` must be a parameter_map over one axis, got a result of bifurcation_diagram",
        ),
        (plotting.index_curve, curve([0.1]), "got 1 along omega"),
        (
            lambda d: plotting.bifurcation_diagram(d, "std"),
            diagram([[1.0]]),
            "unknown `quantity` 'std'; choose from velocity",
        ),
        (lambda s: plotting.index_curve(s, "mean"), curve([0.1, 0.2]), "unknown `index` 'mean'; choose from std"),
    ],
)
def test_another_kind_of_result_is_refused_in_words(draw, wrong, words):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        draw(wrong)
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("first", "second", "scale", "words"),
    [
        (diagram([[1.0]], dim="period"), curve([0.1, 0.2]), 5, "`diagram` must hold impacts"),
        (
            diagram([[1.0]]),
            curve([0.1, 0.2], axis="mass"),
            5,
            "`sweep` must run over omega, as `diagram` does, got mass",
        ),
        (diagram([[1.0]]), curve([0.1, 0.2]), np.nan, "`scale` must be a finite number, got nan"),
    ],
)
def test_a_diagram_and_an_index_that_do_not_belong_together_are_refused(first, second, scale, words):
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        plotting.diagram_with_index(first, second, scale=scale)
    assert words in str(caught.value)


def test_a_result_that_lost_its_oscillator_is_refused_where_the_stop_is_drawn():
    lost = bouncing()
    lost.attrs = {}
    with pytest.raises(ValueError, match="`simulation` has no attribute 'oscillator'"):
        plotting.time_history(lost)


def test_a_figure_of_its_own_leaves_global_settings_alone_and_tells_the_parameters():
    import matplotlib.pyplot as plt

    before = dict(mpl.rcParams)
    drawn = plotting.time_history(bouncing())
    assert dict(mpl.rcParams) == before
    assert "$m$ = 2 kg" in drawn.get_title()
    assert drawn.get_figure() is plt.gcf(), "plt.show() finds it"
    swept = plotting.index_curve(curve([0.1, 0.2]))
    assert r"\omega" not in swept.get_title()
    plt.close("all")


def test_the_sketch_shows_every_symbol_of_the_model_and_the_numbers_of_an_oscillator(ax):
    plotting.oscillator_sketch(OSC, ax)
    shown = " ".join(text.get_text() for text in ax.texts)
    for symbol in ("$m$", "$c$", "$k$", r"$f\,\sin\,\omega t$", "$g$", "$r$", "$y$", "$m$ = 2 kg", "$g$ = 0.5 m"):
        assert symbol in shown


def test_the_table_of_figures_names_public_functions_and_is_read_without_matplotlib():
    assert set(figures.KINDS) == set(plotting.KINDS)
    assert {kind.function for kind in figures.KINDS.values()} <= set(plotting.__all__)
    assert plotting.KINDS["time-history"] is plotting.time_history
    code = "import sys, vibroimpact.figures; sys.exit('matplotlib' in sys.modules)"
    assert python(code).returncode == 0


def test_every_result_has_its_default_kind():
    assert plotting.default_kind(bouncing()) == "time-history"
    assert plotting.default_kind(impacts([0.5], [1.0])) == "impact-map"
    assert plotting.default_kind(strobe([0.5], [1.0])) == "stroboscopic-map"
    assert plotting.default_kind(diagram([[1.0]])) == "bifurcation-diagram"
    assert plotting.default_kind(curve([0.1, 0.2])) == "index-curve"
    with pytest.raises(ValueError, match="must be a result of simulate"):
        plotting.default_kind(xr.Dataset(attrs={"oscillator": json.dumps({})}))

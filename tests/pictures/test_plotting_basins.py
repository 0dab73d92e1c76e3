"""Basin portraits: every start in the colour of its attractor, every colour explained."""

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb

import vibroimpact as vi
from drawn import legend_texts, meshes
from vibroimpact.plotting.categories import OPEN
from vibroimpact.plotting.motions import ATTRACTORS, FURTHER, QUIET, basin_portrait
from vibroimpact.plotting.style import STATUS_COLORS

OSC = vi.ImpactOscillator(omega=3.0)


@pytest.fixture(scope="module")
def found():
    return vi.basins(OSC, phase=np.linspace(0, 1, 31), velocity=np.linspace(0, 3, 21))


def made(numbers, meanings, status=None):
    """Return a portrait with given numbers of attractors, as basins would label it."""
    numbers = np.array(numbers, dtype=np.int16)
    shape, count = numbers.shape, len(meanings)
    phase, velocity = np.linspace(0.0, 1.0, shape[0]), np.linspace(0.0, 1.0, shape[1])
    nothing = ("attractor_id", "point"), np.full((count, 1), np.nan)
    return xr.Dataset(
        {
            "attractor": (
                ("phase", "velocity"),
                numbers,
                {"flag_values": np.arange(-1, count), "flag_meanings": " ".join(["undecided", *meanings])},
            ),
            "status": (("phase", "velocity"), np.zeros(shape, np.int8) if status is None else status),
            "share": ("attractor_id", [(numbers == number).mean() for number in range(count)]),
            "max_velocity": ("attractor_id", np.full(count, np.nan)),
            "point_phase": nothing,
            "point_velocity": nothing,
        },
        coords={"phase": phase, "velocity": velocity},
    )


def shades(ax):
    """Return the colours drawn, shape (second axis, first axis, 3)."""
    (mesh,) = meshes(ax)
    return np.asarray(mesh.get_array())


def test_every_start_has_the_colour_of_its_attractor(found, ax):
    basin_portrait(found, ax=ax)
    expected = np.array([to_rgb(color) for color in ATTRACTORS])[found["attractor"].values.T]
    np.testing.assert_allclose(shades(ax), expected)


def test_the_legend_names_motions_their_hardest_hits_and_shares(found, ax):
    basin_portrait(found, ax=ax)
    first, second = (100 * float(share) for share in found["share"])
    assert legend_texts(ax) == [
        f"period-2 impact-2, impacts up to 0.429 m/s: {first:.1f} %",
        f"period-6 sticking, impacts up to 0.0728 m/s: {second:.1f} %",
        "the attractors themselves",
    ]


def test_axes_carry_symbols_and_units(found, ax):
    basin_portrait(found, ax=ax)
    assert ax.get_xlabel() == r"phase of the driving period $\psi/T$"
    assert ax.get_ylabel() == "impact velocity $I$ [m/s]"
    assert (*ax.get_xlim(), *ax.get_ylim()) == (0.0, 1.0, 0.0, 3.0)


def test_rings_mark_a_cycle_and_dots_a_chatter(found, ax):
    basin_portrait(found, ax=ax)
    rings, dots = ax.get_lines()
    assert int(np.isfinite(rings.get_xdata()).sum()) == 2
    assert int(np.isfinite(dots.get_xdata()).sum()) > 24
    assert rings.get_markersize() > dots.get_markersize()


def test_a_figure_of_its_own_tells_the_oscillator_and_the_phase_of_the_starts():
    portrait = vi.basins(OSC, displacement=[-1.0, -0.5, 0.0], velocity=[-1.0, 0.0], phase=0.25)
    drawn = basin_portrait(portrait)
    assert r"$\omega$ = 3 rad/s" in drawn.get_title()
    assert r"$\psi/T$ = 0.25" in drawn.get_title()
    assert drawn.get_xlabel() == "displacement $y$ [m]"
    mpl.pyplot.close(drawn.figure)


def test_what_never_hits_or_never_moves_is_grey(ax):
    names = ["chaotic", "no_impact", "permanently_in_contact", "at_rest"]
    basin_portrait(made([[0, 1], [2, 3]], names), ax=ax)
    colors = [ATTRACTORS[0], QUIET["no_impact"], QUIET["permanently_in_contact"], QUIET["at_rest"]]
    np.testing.assert_allclose(shades(ax)[[0, 1, 0, 1], [0, 0, 1, 1]], [to_rgb(color) for color in colors])
    assert legend_texts(ax) == [
        "chaotic: 25.0 %",
        "no impact: 25.0 %",
        "permanently in contact: 25.0 %",
        "at rest: 25.0 %",
    ]


def test_starts_without_an_attractor_say_why(ax):
    status = np.array([[0, vi.Status.BUDGET], [vi.Status.INTERRUPTED, 0]], np.int8)
    basin_portrait(made([[-1, -1], [-1, 0]], ["chaotic"], status), ax=ax)
    colors = [OPEN, STATUS_COLORS[vi.Status.BUDGET], STATUS_COLORS[vi.Status.INTERRUPTED], ATTRACTORS[0]]
    np.testing.assert_allclose(shades(ax)[[0, 1, 0, 1], [0, 0, 1, 1]], [to_rgb(color) for color in colors])
    labels = [text.partition(":")[0].partition(" (")[0] for text in legend_texts(ax)]
    assert labels == ["chaotic", "not followed to the end", "interrupted", "undecided"]


def test_many_attractors_share_the_last_colour(ax):
    names = [f"period-{n}_impact-1" for n in range(1, 11)]
    numbers = np.arange(10).reshape(2, 5)
    basin_portrait(made(numbers, names), ax=ax)
    assert legend_texts(ax)[-1] == "3 further attractors: 30.0 %"
    np.testing.assert_allclose(shades(ax)[2:, 1], [to_rgb(FURTHER)] * 3)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (3, "`dataset` must be a result of basins .* got an int"),
        (xr.Dataset({"std": ("omega", [1.0])}), "`dataset` must be a result of basins .* with std"),
        (made([[0, 0]], ["chaotic"]), "`dataset` needs two or more values .* got 1 along phase"),
    ],
)
def test_other_results_are_refused(value, message):
    with pytest.raises(ValueError, match=message):
        basin_portrait(value)

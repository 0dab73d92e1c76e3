"""What a user does with motions against compliant stops: words, pictures, files and commands."""

import re

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.report import sentences_of

FILE = """
import vibroimpact as vi

soft = vi.ImpactSystem(
    mass=1.0, damping=0.1, stiffness=1.0, force=vi.Force(omega=1.3, harmonics={1: 1.0}),
    stops=[
        vi.Stop(direction=1, gap=0.3, stiffness=50.0, damping=0.9, name="buffer"),
        vi.Stop(direction=-1, gap=0.5, restitution=0.7, name="wall"),
    ],
)
"""
OWN = "--model soft.py:soft"


def soft(**changes):
    found = {}
    exec(FILE, found)
    return found["soft"].replace(**changes)


@pytest.fixture(scope="module")
def motion():
    return vi.simulate(soft(), periods=6)


# Words


def test_the_summary_says_what_contacts_came_to(motion):
    buffered = motion["impact_stop"].values == "buffer"
    force, seconds, depth = (motion[name].values[buffered] for name in ("peak_force", "contact_time", "penetration"))
    (line,) = (line for line in sentences_of(motion) if line.startswith("  buffer"))
    words = f"force up to {np.nanmax(force):.4g} N, contacts of up to {np.nanmax(seconds):.4g} s"
    assert line.endswith(f"{words}, penetration up to {np.nanmax(depth):.4g} m")
    (line,) = (line for line in sentences_of(motion) if line.startswith("  wall"))
    assert "force" not in line


# Pictures


def _entry(artists, label):
    (found,) = (artist for artist in artists if artist.get_label() == label)
    return found


def test_the_displacement_goes_beyond_the_gap_and_what_lies_there_is_shaded(shown, motion):
    ax = shown.time_history(motion)
    deepest = 0.3 + float(motion["penetration"].max())
    (shade,) = _entry(ax.collections, "penetration of buffer").get_paths()[:1]
    every = np.concatenate([path.vertices for path in _entry(ax.collections, "penetration of buffer").get_paths()])
    assert shade.vertices[:, 1].min() == pytest.approx(0.3, abs=1e-9)
    assert every[:, 1].max() == pytest.approx(deepest, rel=1e-4)
    assert ax.get_ylim()[1] > deepest


def test_forces_are_drawn_below_each_contact_before_its_box(shown, motion):
    upper, lower = shown.time_history(motion).get_figure().axes
    assert (upper.get_xlabel(), lower.get_xlabel()) == ("", "time $t$ [s]")
    assert lower.get_ylabel().replace("\n", " ") == "force of the stop $F$ [N]"
    time, force = _entry(lower.get_lines(), "force of buffer").get_data()
    assert np.array_equal(force[np.isin(time, motion["time"])][:50], motion["force"].sel(stop="buffer")[:50])
    hits = motion.isel(impact=np.flatnonzero(motion["impact_stop"] == "buffer"))
    (boxes,) = lower.collections
    for path, hit in zip(boxes.get_paths(), (hits.isel(impact=at) for at in range(hits.sizes["impact"])), strict=True):
        (left, low), (right, high) = path.vertices.min(axis=0), path.vertices.max(axis=0)
        assert (low, high) == (0.0, pytest.approx(float(hit["peak_force"])))
        assert (left, right - left) == (float(hit["impact_time"]), pytest.approx(float(hit["contact_time"])))
        inside = (time > left) & (time < right)
        assert force[inside].max() == pytest.approx(high, rel=1e-2)
        # Where contact begins the force jumps to that of the damper.
        assert force[time == left].max() == pytest.approx(0.9 * float(hit["impact_velocity"]))


def test_a_motion_over_before_its_contact_is_drawn(shown, motion):
    begun = float(motion["impact_time"].values[motion["impact_stop"].values == "buffer"][0])
    brief = vi.simulate(soft(), periods=(begun + 0.05) / soft().period)
    assert np.isnan(brief["contact_time"][-1])
    _, lower = shown.time_history(brief).get_figure().axes
    assert np.isfinite(lower.get_ylim()).all()


def test_own_axes_and_rigid_stops_have_no_panel_of_forces(shown, motion):
    import matplotlib.pyplot as plt

    figure, ax = plt.subplots()
    assert shown.time_history(motion, ax) is ax
    assert figure.axes == [ax]
    assert len(shown.time_history(vi.simulate(vi.models.two_sided_oscillator(), periods=1)).get_figure().axes) == 1


def test_no_velocity_jumps_at_a_stop_that_gives(shown, motion):
    ax = shown.phase_portrait(motion)
    assert not [entry for entry in ax.collections if "on buffer" in str(entry.get_label())]
    marks = _entry(ax.get_lines(), f"{int((motion['impact_stop'] == 'buffer').sum())} impacts on buffer").get_data()
    hits = motion["impact_velocity"].values[motion["impact_stop"].values == "buffer"]
    np.testing.assert_allclose(marks, [np.full(len(hits), 0.3), hits], rtol=1e-12)
    (wall,) = (entry for entry in ax.collections if "on wall" in str(entry.get_label()))
    assert len(wall.get_segments()) == int((motion["impact_stop"] == "wall").sum())


def test_a_line_is_not_broken_where_another_stop_gives(shown):
    """Coordinate 0 of two masses goes on smoothly while the second one is pushed."""
    chain = vi.ImpactSystem(
        mass=np.eye(2),
        stiffness=[[2.0, -1.0], [-1.0, 2.0]],
        damping=0.1 * np.eye(2),
        force=vi.Force(omega=1.1, harmonics={1: [1.0, 0.0]}),
        stops=[vi.Stop(direction=[1, 0], gap=2.0), vi.Stop(direction=[0, 1], gap=0.2, stiffness=30.0, name="soft")],
    )
    seen = vi.simulate(chain, periods=8)
    assert (seen["impact_stop"] == "soft").all()
    assert seen.sizes["impact"]
    (line,) = (line for line in shown.phase_portrait(seen, coordinate=0).get_lines() if line.get_label() == "flight")
    assert np.isfinite(line.get_xydata()).all()


def test_a_moving_stop_that_gives_is_shaded_where_it_is(shown):
    """The mass is inside exactly where the force pushes, from the touch on; a spring alone has no damper to let go."""
    stop = vi.Stop(direction=1, gap=0.3, stiffness=20.0, name="jaw", motion={1: 0.1j})
    force = vi.Force(omega=1.3, harmonics={1: 1.0})
    seen = vi.simulate(vi.ImpactSystem(mass=1.0, damping=0.1, stiffness=1.0, force=force, stops=[stop]), periods=5)
    ax = shown.time_history(seen)
    shade = [path.vertices[:, 0] for path in _entry(ax.collections, "penetration of jaw").get_paths()]
    found = np.array([(times.min(), times.max()) for times in shade if np.ptp(times) > 1e-6])
    begins, length = seen["impact_time"].values, seen["contact_time"].values
    np.testing.assert_allclose(found, np.column_stack([begins, begins + length]), atol=1e-2)


def test_a_section_names_the_compliant_stop_in_its_legend(shown):
    pressed = soft(buffer_gap=-0.4, wall_gap=0.42)
    ax = shown.stroboscopic_map(vi.stroboscopic_section(pressed, transient_periods=0, sample_periods=50))
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert {"compliant stop buffer", "stop wall"} <= set(texts)


def test_maps_of_forces_have_units(shown):
    how = {"omega": [1.2, 1.3], "buffer_stiffness": [40.0, 60.0], "transient_impacts": 50, "sample_impacts": 50}
    sweep = vi.parameter_map(soft(), indices=["max_force", "work_rate", "damper_rate"], **how)
    for name, label in {"max_force": "[N]", "work_rate": "[W]", "damper_rate": "[W]"}.items():
        bar = shown.index_contour(sweep, name).get_figure().axes[-1]
        assert label in bar.get_ylabel().replace("mW", "W")


# Commands


@pytest.fixture(autouse=True)
def model(tmp_path):
    (tmp_path / "soft.py").write_text(FILE)


def test_a_simulation_goes_to_every_file_and_is_drawn_from_it(run, tmp_path, motion):
    for ending in (".nc", ".zarr"):
        assert run(f"simulate {OWN} --periods 6 --out motion{ending}")[0] == 0
        assert vi.load(tmp_path / f"motion{ending}").identical(motion)
        for kind in ("time-history", "phase-portrait"):
            assert run(f"plot motion{ending} --kind {kind} --out {kind}{ending}.png")[0] == 0
    assert run(f"simulate {OWN} --periods 6 --out motion.csv")[0] == 0
    assert "peak_force" in (tmp_path / "motion.csv").read_text()


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (f"simulate {OWN} --periods 6", "  buffer: 6 impacts, up to"),
        (f"section {OWN} --sample-impacts 60", "force up to .* N, contacts of up to 0.* s"),
        (f"section {OWN} -p buffer_stiffness=80 -p buffer_damping=0 --sample-impacts 60", "penetration up to"),
        (f"diagram {OWN} --x buffer_stiffness=40:60:3 --sample-impacts 20", "stiffness of buffer 40 to 60 N/m"),
    ],
)
def test_commands_tell_of_stops_that_give(run, command, words):
    code, lines, complaints = run(command)
    assert code == 0, complaints
    assert any(re.search(words, line) for line in lines), lines


@pytest.mark.long
def test_a_map_of_forces_is_told_stored_and_drawn(run, tmp_path):
    plane = "--x buffer_stiffness=40:60:3 --y omega=1.2:1.4:2 --indices max_force,work_rate --sample-impacts 50"
    code, lines, _ = run(f"map {OWN} {plane}")
    assert code == 0
    assert any(line.startswith("largest force of a compliant stop (max_force): ") and " N" in line for line in lines)
    assert run(f"map {OWN} {plane} --by-stop --out each.zarr")[0] == 0
    each = vi.load(tmp_path / "each.zarr")
    assert each["max_force"].sel(stop="wall").isnull().all()
    assert each["max_force"].sel(stop="buffer").notnull().all()
    assert run("plot each.zarr --stop buffer --out buffer.png")[0] == 0
    _, _, (complaint,) = run("plot each.zarr --stop bat --out bat.png")
    assert "unknown `--stop` 'bat'; choose from buffer, wall" in complaint
    assert run(f"map {OWN} {plane} --out whole.nc")[0] == 0
    assert vi.load(tmp_path / "whole.nc")["max_force"].attrs["units"] == "N"
    assert run("plot whole.nc --index work_rate --out map.png")[0] == 0


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (f"section {OWN} -p buffer_stiffness=0", "`buffer_stiffness` must be a finite number > 0, got 0"),
        (f"section {OWN} -p buffer_damping=-1", "`buffer_damping` must be"),
        (f"section {OWN} -p buffer_restitution=0.5", "unknown parameter 'buffer_restitution'"),
        (f"map {OWN} --x omega=1:2:3 --by-stop --out map.png", "a figure shows one stop; with --by-stop write data"),
        ("map --x omega=1:2:3 --indices max_force", "`max_force` needs a compliant stop"),
        (
            "map --model two_sided_oscillator --x frequency=20:30:3 --indices max_force",
            "`max_force` needs a compliant stop",
        ),
    ],
)
def test_what_a_stop_that_gives_has_not_is_refused_in_one_line(refused, command, words):
    assert words in refused(command)

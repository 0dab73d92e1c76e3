"""How a verdict is told: in units, in digits, and without contradicting itself."""

import itertools
import math
import re
from dataclasses import replace

import numpy as np
import pytest

import vibroimpact as vi
from designs import RESTS, TRANSIENTS
from systems import FORMS, THREE, cabinet, one_mass, random_pair, two_sided
from texts import line, text_of
from vibroimpact.verdict import Advice, Comparison, Edge

# The mass rests at the stop again and again, and rounding decides when that ends; it does after some 1e4 impacts.
RESTLESS = vi.ImpactOscillator(damping=0.2015, omega=2.4248, restitution=0.9009, gap=0.2097)
# A third of the initial conditions hit twice as hard for some 2e4 impacts, no rounding involved.
SLOW = vi.ImpactOscillator(
    mass=0.4399088962834013,
    damping=0.4892130134999437,
    stiffness=12233.232186823981,
    amplitude=0.028886743761128916,
    omega=37.03357437899465,
    restitution=0.9496439504642897,
)
NARROW = vi.ImpactOscillator(
    damping=0.002547303444481522, omega=2.0101148729054947, restitution=0.7246201786416921, gap=-0.6627901124900919
)


def verdict_of(osc):
    return vi.describe(osc, parameters=[])


def table_of(verdict):
    """Return the rows of the table of boundaries, each with the texts of its five columns."""
    lines = str(verdict).splitlines()
    at = lines.index("boundaries") + 1
    assert lines[at].split()[0] == "parameter"
    columns = [match.start() for match in re.finditer(r"\S+(?: \S+)*", lines[at])]
    rows = itertools.takewhile(lambda row: re.match(r"  \S| {13}", row), lines[at + 1 :])
    return [[row[i:j].strip() for i, j in itertools.pairwise([*columns, None])] for row in rows]


def told(verdict, down, up):
    """Return what is told of two boundaries: the value and what happens, downwards and upwards."""
    columns = list(zip(*table_of(replace(verdict, boundaries=(down, up))), strict=True))
    return tuple(" ".join(filter(None, column)) for column in columns[1:])


# In units


def test_what_is_given_in_hertz_is_told_in_hertz_too():
    """w = 2 pi 20 Hz."""
    verdict = vi.describe(vi.ImpactOscillator(stiffness=4e4, frequency=20.0), parameters=[])
    assert "omega 125.664 rad/s (20 Hz)" in text_of(verdict)


def test_a_change_of_the_gap_is_told_beside_the_gap_and_beside_the_static_deflection():
    osc = vi.ImpactOscillator(amplitude=2.0, stiffness=2000.0, gap=0.2e-3)  # f/k = 1 mm
    up = Edge("gap", 1, "fold", 0.25e-3, 0.05, "f/k")
    assert told(verdict_of(osc), up, up)[2:] == ("0.00025 +25 % +5 % of f/k", "fold")
    at_zero = Edge("gap", 1, "fold", 0.25e-3, 0.25, "f/k")
    zero_has_no_shares = ("0.00025 +25 % of f/k", "fold")
    assert told(verdict_of(osc.replace(gap=0.0)), at_zero, at_zero)[2:] == zero_has_no_shares
    wide = Edge("gap", 1, "fold", 2.5e-3, 0.25, "")
    assert told(verdict_of(osc.replace(gap=2e-3)), wide, wide)[2:] == ("0.0025 +25 %", "fold")


def test_boundaries_are_a_table_in_the_units_that_were_given():
    """Rows of the text, of the notebook and of a comparison are the same; w = 2 pi n/60."""
    osc = vi.ImpactOscillator(mass=1.2, stiffness=26860.0, damping=8.0, amplitude=100.0, frequency=25.0, gap=0.5e-3)
    units = {"frequency": "rpm", "gap": "mm"}
    own, verdict = (vi.describe(osc, parameters=["omega", "gap"], units=given) for given in (None, units))
    assert own.boundaries == verdict.boundaries
    table = table_of(verdict)[:4]
    assert [row[0] for row in table] == ["frequency [rpm]", "", "gap [mm]", ""]
    edges = iter(verdict.boundaries)
    for row, scale in ((table[0], 30.0 / math.pi), (table[2], 1e3)):
        for place, what in (row[1:3], row[3:5]):
            edge = next(edges)
            value, _, half = place.partition(" ± ")
            assert float(value) == pytest.approx(edge.value * scale, rel=1e-4)
            assert float(half) == pytest.approx(edge.half_width * scale, rel=0.3)
            assert what == edge.what
            assert what in verdict._repr_html_()
            assert place in verdict._repr_html_()
            assert place in str(Comparison(("A", "B"), (verdict, verdict)))
    assert "frequency 1500 rpm" in text_of(verdict)
    assert "gap 0.5 mm" in text_of(verdict)
    advised = verdict.advice[0]
    assert advised.parameter == "omega"
    assert f"frequency by 2.8 % to {advised.value * 30.0 / math.pi:.6g} rpm" in text_of(verdict)
    assert "rad/s" not in text_of(verdict) + str(Comparison(("A", "B"), (verdict, verdict)))
    assert "omega" not in str(verdict)


# In digits


def test_on_a_boundary_no_digits_of_rounding_are_told():
    """A preload k g as large as the force: any more force lifts the mass off the stop."""
    verdict = vi.describe(vi.ImpactOscillator(gap=-1.0), parameters=["amplitude"])
    place, what = told(verdict, *verdict.boundaries)[2:]
    assert place == "at once"
    assert what.startswith("the force first lifts the mass off the stop")
    verdict = verdict_of(vi.ImpactOscillator())
    for digits in (1e-15, -3e-13):
        noise = Edge("omega", 1, "grazing", 2.0 * (1.0 + digits), digits, "", beyond="chaotic")
        assert told(verdict, noise, noise)[2:] == ("at once", "grazing; chaotic beyond")
    near = Edge("omega", 1, "grazing", 2.0 * (1.0 + 1e-9), 1e-9, "")
    assert "at once" not in str(told(verdict, near, near))


def test_what_was_seen_beyond_is_given_with_the_value_at_which_it_was():
    verdict = vi.describe(vi.ImpactOscillator(omega=2.6), parameters=["omega"])
    _, below, _, above = told(verdict, *verdict.boundaries)
    for end, what in zip(verdict.boundaries, (below, above), strict=True):
        assert what == f"period doubling; period-2 impact-2 at {end.beyond_at:.6g}"


def test_a_boundary_is_printed_with_as_many_digits_as_part_it_from_the_present_value():
    verdict = vi.describe(NARROW, parameters=["amplitude"])
    for end in verdict.boundaries:
        assert 0.0 < abs(end.change) < 1e-8
    for place in told(verdict, *verdict.boundaries)[::2]:
        assert float(place.split()[0]) != 1.0
    assert "expect those around it in a machine" in text_of(verdict)


@pytest.mark.parametrize("model", [vi.ImpactOscillator(omega=2.6), random_pair(4)], ids=["one mass", "two masses"])
def test_one_hit_is_printed_with_the_same_digits_throughout(model):
    verdict = vi.describe(model, parameters=["omega"])
    hardest = f"{verdict.worst.max_velocity:.4g} m/s"
    head, _, rest = text_of(verdict).partition("boundaries")
    assert hardest in head
    assert rest.count(hardest) >= 2


def test_advice_that_merely_ends_the_chaos_says_so():
    end = Edge("mass", 1, "fold", 1.5, 0.5, "")
    verdict = replace(verdict_of(vi.ImpactOscillator()), boundaries=(end, end))
    calm = Advice("mass", 1.01, 0.01, "", "no_chaos", "period-10 impact-6", 0.9985, 1.0, 385)
    assert "period-10 impact-6, no longer chaotic, hardest hit" in line(replace(verdict, advice=(calm,)), "advice")
    softer = Advice("mass", 1.01, 0.01, "", "softer", "period-1 impact-1", 0.5, 1.0, 385)
    assert "chaotic" not in line(replace(verdict, advice=(softer,)), "advice")


# Without contradiction


@pytest.mark.long
def test_long_transients_are_told_with_their_length_and_their_hits():
    for osc in (RESTLESS, SLOW):
        verdict = vi.describe(osc, parameters=["omega"])
        motion, *late = verdict.attractors
        assert sum(each.share for each in late) < 0.02  # still on their way after 1e5 impacts
        random = np.random.default_rng(7)
        velocity, phase = 4.0 * osc.velocity_scale * random.random(64), random.random(64)
        starts = [vi.State(osc.gap, v, turn * osc.period) for v, turn in zip(velocity, phase, strict=True)]
        how = {"indices": ("max_velocity",), "transient_impacts": 5100, "sample_impacts": 500}
        hardest = float(vi.parameter_map(osc, omega=[osc.omega], start=starts, **how)["max_velocity"].max())
        assert hardest > 1.5 * motion.max_velocity
        assert hardest == pytest.approx(motion.transient_velocity, rel=0.01)
        assert motion.transient_impacts > 10_000
        assert "some after up to" in text_of(verdict)


def test_where_rounding_decides_how_long_impacts_last_no_value_is_given_from_which_they_do():
    verdict = vi.describe(RESTLESS, parameters=["mass", "gap"])
    assert sum(verdict.releases.values()) == 32
    assert "lasting impacts" not in text_of(verdict)


def test_intermittent_sticking_is_not_called_predictable():
    verdict = vi.describe(vi.ImpactOscillator(omega=2.9), parameters=["omega"])
    assert (verdict.motion.name, verdict.transient) == ("intermittent sticking", "")
    assert verdict.watched >= 100_000
    assert set(verdict.releases) == {"intermittent sticking"}
    assert all(edge.not_sought for edge in verdict.boundaries)  # on either side rounding decides the class as well
    assert "perturbations vanish" not in text_of(verdict)
    assert "no longer chaotic" not in text_of(verdict)


@pytest.mark.usefixtures("modal_engine")
@pytest.mark.parametrize("kind", [lambda osc: osc, one_mass], ids=["one mass", "as a system"])
def test_no_impacts_are_claimed_of_initial_conditions_that_are_undecided(kind):
    """Without loss nothing attracts; from rest the spring presses the mass to the stop."""
    pressed = vi.ImpactOscillator(amplitude=0.0, damping=0.0, restitution=1.0, gap=-0.5)
    verdict = text_of(verdict_of(kind(pressed)))
    assert "100 % of the initial conditions: motions of constant energy" in verdict
    assert "no impacts from rest, but 100 % of the initial conditions keep the energy with which they hit" in verdict
    assert "from any of" not in verdict


@pytest.mark.long
@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("name", TRANSIENTS)
def test_a_long_chaotic_transient_is_named_beside_the_motion_that_it_ends_in(name, form):
    verdict = vi.describe(form(TRANSIENTS[name]), parameters=[])
    assert verdict.motion.name == name
    assert verdict.transient == "chaotic"
    assert f"certain after {verdict.watched} impacts: the first 5100 look chaotic" in text_of(verdict)
    assert verdict.max_velocity == pytest.approx(
        max(verdict.orbit.velocities if verdict.orbit else verdict.motion.velocities)
    )


def test_chaos_is_said_to_last_as_long_as_it_was_watched():
    verdict = vi.describe(vi.ImpactOscillator(omega=2.8), parameters=[])
    assert (verdict.kind, verdict.transient) == ("chaotic", "")
    assert verdict.watched >= 100_000
    assert f"watched over {verdict.watched} impacts" in text_of(verdict)


@pytest.mark.parametrize("velocity", RESTS)
def test_a_rest_that_rounding_decides_is_named_by_where_most_releases_lead(velocity):
    verdict = vi.describe(RESTS[velocity], parameters=[])
    assert (verdict.motion.name, verdict.transient) == ("period-1 impact-1", "intermittent sticking")
    assert (verdict.max_velocity, verdict.indices["max_velocity"]) == pytest.approx((velocity, velocity), abs=1e-3)
    assert sum(verdict.releases.values()) == 32
    assert verdict.releases["period-1 impact-1"] > 16
    assert "rounding decides" in text_of(verdict)


@pytest.mark.parametrize(
    ("name", "together"),
    [("chaotic", False), ("period-40 impact-81", False), ("quasi-periodic", True), ("intermittent sticking", True)],
)
def test_only_motions_that_are_not_told_apart_are_said_to_count_as_one(name, together):
    verdict = vi.describe(two_sided(), parameters=[])
    motion = replace(verdict.attractors[0], name=name, share=1.0)
    words = line(replace(verdict, attractors=(motion,)), "coexisting")
    assert "settle to this motion" in words
    assert (f"but all {name} motions count as one" in words) == together


@pytest.mark.usefixtures("modal_engine")
def test_a_system_that_ends_at_rest_at_a_stop_is_said_once_to_rest():
    system = vi.ImpactOscillator(amplitude=0.0, gap=-0.1).system
    assert "motion      from rest at rest at the stop\n" in str(vi.describe(system, parameters=[]))


def test_one_mass_and_the_same_as_a_system_are_told_in_the_same_words():
    for osc in (vi.ImpactOscillator(omega=2.6), vi.ImpactOscillator(omega=2.0, gap=0.3)):
        one, same = (vi.describe(model, parameters=[]) for model in (osc, one_mass(osc)))
        for title in ("motion", "energy", "stability", "coexisting"):
            assert line(one, title) == line(same, title)
        impulse = f" largest impulse {same.orbit.impulses[0]:.4g} N s"
        assert line(one, "hits") + impulse == line(same, "hits")


# Requests


OSC = vi.ImpactOscillator()


@pytest.mark.parametrize(("model", "arguments", "words"), [
    (OSC, {"parameters": ["omga"]}, "did you mean 'omega'"),
    (OSC, {"parameters": ["gap", "gap"]}, "drop the repeated one"),
    (OSC, {"within": 0.0}, "`within` must be above 0 and up to 1000, got 0.0"),
    (OSC, {"within": "far"}, "`within` must be above 0 and up to 1000, got 'far'"),
    (OSC, {"units": {"gpa": "mm"}}, "unknown parameter 'gpa'"),
    (OSC, {"units": {"gap": "s"}}, "`units['gap']` must be a unit that m can be turned into, got 's'"),
    (OSC, {"units": {"gap": 5}}, "`units['gap']` must be a unit that m can be turned into, got 5"),
    (OSC, {"units": {"restitution": "mm"}}, "`units['restitution']` must be 1 or %, got 'mm'"),
    (OSC, {"units": "mm"}, '`units` must be units by parameter, such as {"gap": "mm"}, got \'mm\''),
    (THREE, {"parameters": ["right_gp"]}, "did you mean 'right_gap'"),
    (THREE, {"parameters": ["omega", "omega"]}, "drop the repeated one"),
    (THREE, {"within": 0.0}, "`within` must be above 0 and up to 1000, got 0.0"),
    (THREE, {"units": {"right_gap": "s"}}, "`units['right_gap']` must be a unit that m can be turned into, got 's'"),
    (THREE, {"units": {"left_restitution": "mm"}}, "`units['left_restitution']` must be 1 or %, got 'mm'"),
    (3, {}, "`osc` must be an ImpactOscillator, an ImpactSystem or a family, got 3"),
])  # fmt: skip
def test_a_wrong_request_names_the_argument_and_the_remedy(model, arguments, words):
    with pytest.raises(ValueError, match=re.escape(words)):
        vi.describe(model, **arguments)


def test_of_a_motion_that_stays_undecided_nothing_is_certain():
    """Perturbations shrink by 0.01 % a period, to half in 5,500."""
    text = text_of(vi.describe(cabinet(15.0, 5e-4), parameters=[]))
    assert "from rest undecided" in text
    assert "certain after" not in text
    assert "watched over 32768 impacts: the first 5100 look quasi-periodic" in text
    assert "perturbations change in size by less than 0.1 % per period" in text
    assert "seen to be reached from none" in text

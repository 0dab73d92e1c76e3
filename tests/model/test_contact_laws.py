"""Laws of restitution: closed forms in 50 digits, contacts integrated, tables, functions, and what is refused."""

import math
import pickle

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.linalg import expm
from scipy.optimize import brentq

import vibroimpact as vi
from vibroimpact.contact import hunt_crossley, kelvin_voigt, law_of, piecewise
from vibroimpact.contact.fingerprint import fingerprint
from vibroimpact.contact.rules import TRIED

TABLE = {"speeds": [0.1, 0.5, 2.0, 3.0], "values": [0.9, 0.8, 0.4, 0.4]}
SCALE = 0.7


def softening(v):
    return SCALE / (1.0 + v**0.5)


def exact_hunt_crossley(x):
    """Return r and its derivative at x = D v from the law, and the derivative of its two sides."""
    with mpmath.workdps(60):
        x = mpmath.mpf(x)
        left = mpmath.exp(-x) * (1 + x)
        w = mpmath.lambertw(-left * mpmath.exp(-1))  # (y - 1) e^(y - 1) = -(1 + x) e^(-x - 1), y = r x
        y = (1 + w).real
        r = y / x
        slope = x / (1 + x) * (1 - y) / y
        return float(r), float((slope - r) / x), float(1 - r)


@pytest.mark.parametrize("x", [10.0**e for e in range(-12, 7)] + [0.0499999, 0.05, 0.3, 2.5, 40.0])
def test_hunt_and_crossleys_law_is_exact_from_rest_to_any_speed(x):
    r, slope, lost = exact_hunt_crossley(x)
    for damping in (1.0, 0.4):
        law = hunt_crossley(damping=damping)
        v = x / damping
        assert law(v) == pytest.approx(r, rel=1e-12)
        assert 1.0 - law(v) == pytest.approx(lost, rel=1e-12, abs=2.3e-16)
        assert law.slope(v) == pytest.approx(damping * slope, rel=1e-12)


@pytest.mark.parametrize("power", [1.0, 1.5])
def test_hunt_and_crossleys_law_is_what_its_contact_does(power):
    def contact(t, y):
        return [y[1], -(max(y[0], 0.0) ** power) * (1.0 + 0.7 * y[1])]

    def parted(t, y):
        return y[0]

    parted.terminal, parted.direction = True, -1.0
    found = solve_ivp(contact, (0.0, 50.0), [0.0, 1.3], events=parted, rtol=1e-11, atol=1e-13, method="DOP853")
    assert -found.y[1, -1] / 1.3 == pytest.approx(hunt_crossley(damping=0.7)(1.3), rel=1e-7)


@pytest.mark.parametrize("ratio", [0.0, 0.05, 0.2, 0.9, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.1, 4.0])
def test_kelvin_and_voigts_law_is_what_its_contact_leaves_where_the_force_is_zero(ratio):
    matrix = np.array([[0.0, 1.0], [-1.0, -2.0 * ratio]])

    def force(t):
        return float(np.array([1.0, 2.0 * ratio]) @ expm(matrix * t)[:, 1])

    ends = [t for t in np.linspace(0.05, 4.0, 80) if force(t) < 0.0]
    t = brentq(force, 1e-6 if ratio > 0.0 else 0.1, ends[0], xtol=1e-15, rtol=1e-15)
    law = kelvin_voigt(damping_ratio=ratio)
    assert law(3.0) == pytest.approx(-expm(matrix * t)[1, 1], abs=1e-12)
    assert (law.slope(0.3), law([0.1, 5.0]).tolist()) == (0.0, [law(1.0)] * 2)


def test_kelvin_and_voigts_published_value():
    assert kelvin_voigt(damping_ratio=0.2)(1.0) == pytest.approx(0.571740027585, abs=5e-13)


def test_a_table_is_scipys_monotone_curve_and_constant_outside():
    law, curve = piecewise(**TABLE), PchipInterpolator(TABLE["speeds"], TABLE["values"])
    v = np.linspace(0.1, 3.0, 500)[:-1]
    assert law(v) == pytest.approx(curve(v), abs=1e-15)
    assert law.slope(v) == pytest.approx(curve.derivative()(v), abs=1e-14)
    assert law([0.0, 3.0, 9.0]).tolist() == [0.9, 0.4, 0.4]
    assert law.slope([0.0, 3.0, 9.0]).tolist() == [0.0, 0.0, 0.0]
    assert (np.diff(law(v)) <= 1e-16).all()


@pytest.mark.parametrize(
    ("function", "slope"),
    [
        (softening, lambda v: -SCALE * 0.5 * v**-0.5 / (1.0 + v**0.5) ** 2),
        (lambda v: math.exp(-v), lambda v: -math.exp(-v)),
        (lambda v: 0.3, lambda v: 0.0),
    ],
)
def test_the_derivative_of_a_function_is_good_to_a_billionth(function, slope):
    law = law_of(function)
    for v in (1e-9, 1e-3, 0.2, 1.0, 30.0):
        assert law(v) == function(v)
        assert law.slope(v) == pytest.approx(slope(v), abs=1e-9 * max(function(v), 1e-300) * max(1.0, v) / v)


def test_a_table_cannot_be_changed_after_it_was_given():
    speeds, values = [0.1, 0.5], np.array([0.9, 0.8])
    law = piecewise(speeds, values)
    values[1] = speeds[1] = 0.3
    assert law == piecewise([0.1, 0.5], [0.9, 0.8])
    assert repr(law) == "piecewise(speeds=(0.1, 0.5), values=(0.9, 0.8))"


def test_laws_are_what_they_are_made_of():
    laws = [hunt_crossley(damping=0.4), kelvin_voigt(damping_ratio=0.4), piecewise(**TABLE), law_of(softening)]
    for at, law in enumerate(laws):
        copy = pickle.loads(pickle.dumps(law))
        assert (copy, hash(copy), copy(0.7)) == (law, hash(law), law(0.7))
        assert [law == other for other in laws] == [number == at for number in range(4)]
    assert hunt_crossley(damping=0.4) != hunt_crossley(damping=0.5)
    assert repr(laws[0]) == "hunt_crossley(damping=0.4)"
    assert repr(laws[3]) == "softening"


def test_a_function_is_known_by_its_code_and_the_values_that_it_uses():
    def made(most):
        return lambda v: most / (1.0 + v)

    assert law_of(made(0.5)) == law_of(made(0.5)) != law_of(made(0.6))
    assert fingerprint(softening) != fingerprint(made(0.5))
    names = {"SCALE": 0.7}
    exec("def f(v):\n    return SCALE * g(v)\ndef g(v):\n    return v / (1 + v)", names)
    before = fingerprint(names["f"])
    exec("def g(v):\n    return v / (2 + v)", names)
    assert fingerprint(names["f"]) != before


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: hunt_crossley(damping=-1.0), "`damping` must be a finite number >= 0, got -1"),
        (lambda: kelvin_voigt(damping_ratio=math.nan), "`damping_ratio` must be a finite number >= 0, got nan"),
        (lambda: piecewise([0.1], [0.5]), "equally long, at least 2"),
        (lambda: piecewise([0.1, 0.2], [0.5]), "equally long, at least 2, got 2 and 1"),
        (lambda: piecewise([0.2, 0.1], [0.5, 0.4]), "`speeds` must be ascending numbers >= 0"),
        (lambda: piecewise([0.1, 0.2], [0.5, 1.4]), "`values` must be numbers from 0 to 1"),
        (lambda: vi.Stop(direction=1, gap=0, restitution=lambda v: 1.0 + v), r"got 1\.\d* at a speed of"),
        (lambda: vi.Stop(direction=1, gap=0, restitution=lambda v: 0.5 - v), r"got -\d.*at a speed of"),
        (lambda: vi.Stop(direction=1, gap=0, restitution=lambda v: math.nan), "got nan at a speed of"),
        (lambda: vi.Stop(direction=1, gap=0, restitution=lambda: 0.5), "fails at a speed of"),
        (lambda: vi.Stop(direction=1, gap=0, restitution=softening, stiffness=2.0), "None for a compliant stop"),
        (lambda: vi.ImpactOscillator(restitution=softening), r"ImpactSystem\(.*restitution=law\)\]\)"),
        (lambda: hunt_crossley(damping=1.0)(-0.1), "`v` must be speeds >= 0"),
    ],
)
def test_what_is_no_law_is_refused_in_words(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_stop_with_a_law_has_no_restitution_for_a_parameter():
    stop = vi.Stop(direction=1.0, gap=0.1, restitution=softening, name="bar")
    system = vi.ImpactSystem(mass=1.0, stiffness=1.0, force=vi.Force(omega=2.0, harmonics={1: 1.0}), stops=[stop])
    assert set(system.parameters) == {"omega", "frequency", "bar_gap"}
    assert system.replace(bar_gap=0.3).stops[0].restitution == law_of(softening)
    assert pickle.loads(pickle.dumps(system)) == system
    assert hash(system) == hash(system.replace(bar_gap=0.1))
    assert stop.replace(restitution=0.5).kinds == ("gap", "restitution")
    assert "restitution=softening" in repr(stop)
    with pytest.raises(ValueError, match="bar_restitution"):
        system.replace(bar_restitution=0.5)
    assert stop.rebound(TRIED).tolist() == law_of(softening)(TRIED).tolist()


@pytest.mark.parametrize("r", [1.0, 1.0 - 1e-9, 0.6, math.exp(-2.0), 0.13, 1e-3, 1e-12])
def test_the_damper_for_a_wanted_restitution_gives_it_to_the_contacts_of_a_stop(r):
    stiffness, mass = 3e4, 0.7
    damping = vi.contact.damping_for(r, stiffness, mass)
    assert vi.contact.restitution_of(damping, stiffness, mass) == pytest.approx(r, rel=4e-15)
    if r > 0.1:
        pair = [vi.Stop(direction=a, gap=0.5, stiffness=stiffness, damping=damping) for a in (1.0, -1.0)]
        between = vi.ImpactSystem(mass=mass, stiffness=0.0, force=vi.Force(omega=1.0), stops=pair)
        hits = vi.impact_section(between, start=vi.State(0.0, 2.0), transient_impacts=0, sample_impacts=3)
        assert hits["velocity"].values == pytest.approx([2.0, 2.0 * r, 2.0 * r**2], rel=1e-12)


def test_the_damper_for_a_restitution_is_the_root_in_50_digits():
    with mpmath.workdps(50):
        for r in ("0.9", "0.6", "0.2"):
            zeta = mpmath.findroot(
                lambda z, r=r: 2 * z * mpmath.acos(z) / mpmath.sqrt(1 - z**2) + mpmath.log(mpmath.mpf(r)),
                (0.01, 0.9), solver="anderson",
            )  # fmt: skip
            exact = float(2 * zeta * mpmath.sqrt(6))
            assert vi.contact.damping_for(float(r), 2.0, 3.0) == pytest.approx(exact, rel=4e-15)


@pytest.mark.parametrize("arguments", [(0.0, 1.0, 1.0), (1.1, 1.0, 1.0), (0.5, 0.0, 1.0), (0.5, 1.0, -1.0)])
def test_no_damper_is_given_for_what_none_can_do(arguments):
    with pytest.raises(ValueError, match="must be"):
        vi.contact.damping_for(*arguments)

"""Mirror images: motions of a symmetric system that no index tells apart."""

import numpy as np
import pytest

import vibroimpact as vi
from systems import two_sided


def velocities_at_stops(system, start):
    """Return the mean velocity at each stop of a long motion."""
    hits = vi.impact_section(system, start=start, transient_impacts=5000, sample_impacts=20000)
    return [float(hits["velocity"].values[hits["stop"].values == stop].mean()) for stop in system.stop_names]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("omega", [1.18, 1.22])
def test_a_verdict_names_the_one_of_two_chaotic_twins_that_rest_leads_to(omega, sign):
    """Their means over all impacts are the same; one hits the first stop twice as hard as the second, one half."""
    system = two_sided(force=vi.Force(omega=omega, harmonics={1: sign}))
    first, other = vi.describe(system, parameters=[]).attractors
    assert first.from_rest
    assert first.chaotic
    assert other.chaotic
    mine = velocities_at_stops(system, None)
    assert mine[0] > 1.9 * mine[1] or mine[1] > 1.9 * mine[0]
    np.testing.assert_allclose(velocities_at_stops(system, first.start), mine, rtol=0.02)
    np.testing.assert_allclose(velocities_at_stops(system, other.start), mine[::-1], rtol=0.02)

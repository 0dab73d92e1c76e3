"""
Twins between two stops
=======================

A mass midway between two equal stops strikes both alike, until it does not: at a pitchfork the symmetric orbit
becomes unstable, and two orbits take its place, mirror images of each other. The initial condition decides between
them.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi
from vibroimpact.continuation.windows import follow_all

model = vi.family(vi.models.two_sided_oscillator)
(orbit,) = (
    found
    for found in vi.find_orbit(model, n_impacts=2)
    if found.symmetric and found.stable
)
branches = follow_all([orbit], "frequency", (16.5, 25.5), doublings=1)
pitchforks = [point.value for point in branches[0].special if point.kind == "pitchfork"]
assert np.allclose(sorted(pitchforks), [17.597168424, 22.794975716], atol=1e-8)

# %%
# The branches over what a sweep from rest sees, and the twins of one frequency.

figure, (left, right) = plt.subplots(
    1, 2, figsize=(12, 5.0), layout="constrained", width_ratios=(1.5, 1)
)
sweep = vi.bifurcation_diagram(
    model,
    frequency=np.linspace(16.5, 25.5, 300),
    transient_impacts=2000,
    sample_impacts=40,
)
vi.plotting.branch_diagram(branches, sweep, ax=left)
near = min(branches[-1].orbits, key=lambda found: abs(found.value("frequency") - 21.5))
(near,) = vi.find_orbit(model.replace(frequency=21.5), n_impacts=2, near=near)
for twin, colour in ((near, "#d55e00"), (near.twin, "#0072b2")):
    hits = zip(twin.velocities, twin.stops, strict=True)
    motion = vi.simulate(
        twin.system, start=twin.start, periods=1, samples_per_period=2000
    ).isel(coordinate=0)
    right.plot(
        1e3 * motion["displacement"],
        motion["velocity"],
        color=colour,
        label=" and ".join(
            f"{velocity:.3f} m/s on the {stop}" for velocity, stop in hits
        ),
    )
right.set(xlabel="displacement $q$ [mm]", ylabel="velocity $q'$ [m/s]")
right.set_title(f"the twins at {near.value('frequency'):.3g} Hz")
right.locator_params(axis="x", nbins=5)
right.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14))
plt.show()

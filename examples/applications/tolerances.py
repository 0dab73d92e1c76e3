"""
Tolerances by Monte Carlo
=========================

A shaker's clearance, restitution and unbalance scatter from part to part. How hard do the parts of a series hit? A
table of designs, one per row, goes into one call. The spread is nothing like a bell: these designs lie near a
boundary between two motions, so they hit in one way or in another, and the mean describes neither.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi


@vi.family(units={"unbalance": "kg m", "clearance_mm": "mm", "rpm": "1/min"})
def shaker(unbalance=0.002, clearance_mm=1.0, restitution=0.7, rpm=2600.0):
    """Return a 2 kg shaker on a spring, driven by an unbalance."""
    omega = rpm * 2 * np.pi / 60
    return vi.ImpactOscillator(
        mass=2.0,
        stiffness=3e4,
        damping=5.0,
        amplitude=unbalance * omega**2,
        omega=omega,
        gap=clearance_mm / 1e3,
        restitution=restitution,
    )


# %%
# Two thousand parts: normal tolerances of clearance and unbalance, restitution anywhere in its band. Each part is
# computed from four initial conditions, and the hardest counts.

random = np.random.default_rng(1)
parts = {
    "clearance_mm": random.normal(1.0, 0.1, 2000),
    "unbalance": random.normal(0.002, 0.0001, 2000),
    "restitution": random.uniform(0.6, 0.8, 2000),
}
sample = vi.parameter_map(
    shaker,
    points=parts,
    start=4,
    indices=["max_velocity"],
    transient_impacts=500,
    sample_impacts=300,
)
hardest = sample["max_velocity"].max("start").fillna(0.0)
mean, most = float(hardest.mean()), float(hardest.quantile(0.95))
near = float((abs(hardest - mean) < 0.05).mean())
print(
    f"on average {mean:.2f} m/s, and 95 % of the parts below {most:.2f} m/s; {near:.0%} within 0.05 of the mean"
)
assert near < 0.15

# %%
# Each part as a dot over two of its numbers, and how hard how many of them hit.

figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
vi.plotting.index_scatter(sample, "max_velocity", ax=left)
right.hist(hardest, bins=60, color="#0072b2")
right.axvline(mean, color="0.3", linestyle="--", label="mean")
right.axvline(most, color="#d55e00", label="95 % of the parts hit less hard")
right.set(xlabel="hardest hit [m/s]", ylabel="parts of 2000")
right.legend(frameon=False)
plt.show()

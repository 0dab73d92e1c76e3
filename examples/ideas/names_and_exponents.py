"""
Motions and exponents
=====================

The same plane, asked two other questions in one pass: which motion is it, and do neighbouring motions part? Colours
name periodic, sticking and chaotic motions; the largest exponent is positive where the motion is chaotic.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

names = ["lyapunov", "lyapunov_per_impact", "n_periods", "n_impacts"]
axes = {"omega": np.linspace(0.5, 5, 300), "mass": np.linspace(0.1, 5, 200)}
sweep = vi.parameter_map(
    vi.ImpactOscillator(), **axes, indices=names, sample_impacts=1000
)

# %%
# Most cells are periodic; no periodic cell has a positive exponent.

classes = vi.classify(sweep)["motion"]
meanings = classes.attrs["flag_meanings"].split()
periodic, chaotic = (
    classes == meanings.index(name) for name in ("periodic", "chaotic")
)
print(f"{float(periodic.mean()):.0%} periodic, {float(chaotic.mean()):.0%} chaotic")
assert (
    float(sweep["lyapunov"].where(periodic).max())
    < 0
    < float(sweep["lyapunov"].where(chaotic).min())
)

# %%

vi.plotting.motion_map(sweep)
vi.plotting.exponent_map(sweep)
plt.show()

"""
A stability map
===============

Two parameters, 86,400 cells, one call: the standard deviation of the impact velocities over driving frequency and
mass, as in figure 11b of Lee's paper. Dark means that all impacts are alike.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator()
sweep = vi.parameter_map(
    osc,
    omega=np.linspace(0.5, 5, 360),
    mass=np.linspace(0.1, 5, 240),
    sample_impacts=2000,
)
assert sweep["std"].size == 86_400
# %%
# The dashed line is the mass of ``osc``, 1 kg.

vi.plotting.index_contour(sweep, "std", reference={"mass": 1.0})
plt.show()

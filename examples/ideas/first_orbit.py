"""
A first orbit
=============

Seven numbers make an oscillator; what is left out has a default, all dimensionless. Followed in time, then named: two
unequal impacts per driving period.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt

import vibroimpact as vi

osc = vi.ImpactOscillator(omega=0.95)
orbit = vi.simulate(osc, periods=12)
settled = vi.impact_section(osc, sample_impacts=200)
assert vi.recognise(settled).name == "period-1 impact-2"
print(vi.recognise(settled).sentence(osc.period))

# %%
# In time and in the phase plane, both with the stop.

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained")
vi.plotting.time_history(orbit, ax=left)
vi.plotting.phase_portrait(orbit, ax=right)
plt.show()

# %%
# The same as a film, for a talk.

with TemporaryDirectory() as folder:
    vi.plotting.animate(orbit, Path(folder, "orbit.gif"), seconds=1.0)

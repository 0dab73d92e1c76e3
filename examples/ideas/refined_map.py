"""
A fine map at the price of its boundaries
=========================================

Most of a map is one motion next to the same motion. ``refine`` computes a coarse grid, then halves its intervals, but
only where motions change: here a map of 513 x 513 cells, of which it computes less than half.
"""

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

axes = {"omega": np.linspace(0.5, 5, 65), "mass": np.linspace(0.1, 5, 65)}
plane = vi.refined_map(vi.ImpactOscillator(), refine=3, sample_impacts=1000, **axes)
assert plane["std"].shape == (513, 513)
assert plane.attrs["fraction_computed"] < 0.5

# %%
# Left the motions, right the level at which each cell was computed; white cells were filled in.

figure, (left, right) = plt.subplots(1, 2, figsize=(14, 5.4), layout="constrained")
vi.plotting.motion_map(plane, ax=left)
left.set_title(f"{plane.sizes['omega']} x {plane.sizes['mass']} cells")
levels = np.ma.masked_less(plane["level"].transpose("mass", "omega").values, 0)
colours = mpl.colormaps["viridis_r"].resampled(4)
mesh = right.pcolormesh(
    plane["omega"],
    plane["mass"],
    levels,
    cmap=colours,
    vmin=-0.5,
    vmax=3.5,
    rasterized=True,
)
right.set(
    xlabel=left.get_xlabel(),
    title=f"{plane.attrs['fraction_computed']:.0%} of them computed",
)
right.grid(visible=False)
figure.colorbar(
    mesh, ax=right, ticks=range(4), label="level of computation (white: filled in)"
)
plt.show()

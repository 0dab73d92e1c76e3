"""A stability map: Std over driving frequency and mass, as in figure 11b of Lee's paper.

Run it: python stability_map.py. It draws stability_map.png.
"""

import numpy as np

import vibroimpact as vi

osc = vi.ImpactOscillator()
sweep = vi.parameter_map(osc, omega=np.linspace(0.5, 5, 120), mass=np.linspace(0.1, 5, 80), sample_impacts=1000)
axes = vi.plotting.index_contour(sweep, "std", reference={"mass": 1.0})
vi.plotting.save_figure(axes, "stability_map.png", overwrite=True)

"""One orbit of the default oscillator: what it does in time, and what it settles to.

Run it: python first_orbit.py. It prints the motion and draws first_orbit.png.
"""

import matplotlib.pyplot as plt

import vibroimpact as vi

osc = vi.ImpactOscillator(omega=0.95)
orbit = vi.simulate(osc, periods=12)
settled = vi.impact_section(osc, sample_impacts=200)
print(vi.recognise(settled).sentence(osc.period))

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained")
vi.plotting.time_history(orbit, ax=left)
vi.plotting.phase_portrait(orbit, ax=right)
figure.savefig("first_orbit.png", dpi=120)

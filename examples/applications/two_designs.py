"""
Two designs side by side
========================

``compare`` answers for two designs what an engineer asks of each: what does it do, how hard does it hit, how far is
it from doing something else, and what softens it? The picture shows the motion, the phase plane and the impacts of
both.
"""

import matplotlib.pyplot as plt

import vibroimpact as vi

osc = vi.ImpactOscillator()
regular, chaotic = osc.replace(omega=1.4), osc.replace(omega=2.8)
both = vi.compare(regular, chaotic, parameters=["omega"])
assert [verdict.motion.name for verdict in both.verdicts] == [
    "period-1 impact-1",
    "chaotic",
]
print(both)

# %%

vi.plotting.comparison_figure([regular, chaotic], size=(8.4, 8.8))
plt.show()

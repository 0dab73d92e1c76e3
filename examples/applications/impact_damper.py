"""
An impact damper, tuned by a map
================================

A particle of a twentieth of the mass rattles in a slot of a structure and takes its energy. How wide should the slot
be? Too narrow, and the particle is mere mass; too wide, and it hardly hits. The structure's damper dissipates c times
the mean square of its velocity, an index of every map: so one map over frequency and clearance shows how strongly the
structure swings, and the best clearance is the one whose worst frequency is least.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

machine = vi.family(
    vi.models.impact_damper
)  # 10 kg at 30 Hz, 1 % damping, 50 N, a particle of 0.5 kg, r = 0.7
damping = 2 * 0.01 * 10.0 * 2 * np.pi * 30.0  # N s/m

# %%
# The map: settled motions from rest, then the root mean square of the structure's velocity.

clearance = np.linspace(0.5e-3, 40e-3, 60)
sweep = vi.parameter_map(
    machine,
    frequency=np.linspace(26.0, 34.0, 65),
    clearance=clearance,
    indices=["damper_rate"],
    transient_impacts=1000,
    sample_impacts=1000,
)
omega = 2 * np.pi * sweep["frequency"]
alone = (
    50.0
    / np.hypot(damping, 10.0 * ((2 * np.pi * 30.0) ** 2 / omega - omega))
    / np.sqrt(2)
)
rms = np.sqrt(sweep["damper_rate"] / damping).fillna(
    alone
)  # no value: the slot is wider than the swing, so no impacts
worst = rms.max("frequency")
best = float(worst.idxmin("clearance"))
before, after = float(alone.max()), float(worst.min())
print(
    f"worst rms velocity {before:.3f} m/s without, {after:.3f} m/s with a slot of {1e3 * best:.1f} mm"
)
assert after < before / 2.5

# %%
# Drawn with the best clearance as a line, and the frequency response there.

figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.6), layout="constrained")
mesh = left.pcolormesh(
    rms["frequency"],
    1e3 * clearance,
    rms.transpose("clearance", "frequency"),
    rasterized=True,
)
figure.colorbar(mesh, ax=left, label="rms velocity of the structure [m/s]")
left.axhline(1e3 * best, color="#d55e00", linestyle="--")
left.set(xlabel="driving frequency [Hz]", ylabel="clearance [mm]")
for gap, color in ((best, "#d55e00"), (clearance[0], "#0072b2")):
    line = rms.sel(clearance=gap, method="nearest")
    right.plot(line["frequency"], line, color=color, label=f"{1e3 * gap:.1f} mm")
right.plot(
    alone["frequency"], alone, color="0.3", linestyle=":", label="without the particle"
)
right.set(xlabel="driving frequency [Hz]", ylim=(0, None))
right.legend(frameon=False)
plt.show()

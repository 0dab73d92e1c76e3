r"""
A rig with a beam as stop
=========================

A rigid stop has an impulse, but no force. A stop with a stiffness has both: here a mass on a spring meets a beam. Its
force begins with a jump, the beam's damping times the speed, and the contact ends where the force, not the
penetration, is zero. The stiffer the beam, the harder and the shorter the contact; its impulse tends to that of a
rigid stop.
"""

import matplotlib.pyplot as plt
import numpy as np

import vibroimpact as vi

rig = vi.family(vi.models.bilinear_oscillator)

# %%
# Two settled periods: what is inside the beam is shaded, and each contact stands before a box as high as its largest
# force.

still = vi.simulate(rig, periods=300, samples_per_period=1).isel(time=-1)
start = vi.State(
    still["displacement"].values.round(8), still["velocity"].values.round(8)
)
vi.plotting.time_history(
    vi.simulate(rig, start=start, periods=2, samples_per_period=1000)
).set_title("settled motion")

# %%
# Over the stiffness of the beam: from 1e6 N/m on the force grows almost with its root, and the impulse hardly
# changes.

stiffness = np.logspace(4, 8, 17)
contacts = []
for k in stiffness:
    stiffer = rig.replace(
        stop_stiffness=k, stop_damping=20.0 * np.sqrt(k / 1.2e5)
    )  # of the same damping ratio
    contacts.append(
        vi.impact_section(stiffer, transient_impacts=500, sample_impacts=4).max(
            "impact"
        )
    )
force, impulse = (
    np.array([float(hit[name]) for hit in contacts])
    for name in ("peak_force", "impulse")
)
stiff = stiffness > 0.99e6
assert (
    abs(np.polyfit(np.log(stiffness[stiff]), np.log(force[stiff]), 1)[0] - 0.5) < 0.05
)
assert np.ptp(impulse[stiff]) < 0.15 * impulse[stiff].mean()
figure, ax = plt.subplots(figsize=(7, 4), layout="constrained")
ax.loglog(stiffness, force, "o-", label="largest force [N]")
ax.loglog(stiffness, impulse, "s-", label="impulse [N s]")
ax.set(xlabel="stiffness of the beam [N/m]")
ax.legend(frameon=False)
plt.show()

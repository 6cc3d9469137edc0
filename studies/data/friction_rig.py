"""Makes friction_rig.csv: loops of a lap joint beside a flexure, 400 discrete sliders with noise of 4 N."""

import numpy as np

KT, FS, CHI, BETA = 2e7, 900.0, -0.4, 0.6  # N/m, N
FLEXURE = 2e6  # N/m
PHI = FS * (1 + BETA) / (KT * (BETA + (CHI + 1) / (CHI + 2)))
R = FS * (CHI + 1) / (PHI ** (CHI + 2) * (BETA + (CHI + 1) / (CHI + 2)))

edges = PHI * np.linspace(0, 1, 401) ** 2
stiffness = R / (CHI + 1) * np.diff(edges ** (CHI + 1))
moment = R / (CHI + 2) * np.diff(edges ** (CHI + 2))
limit = np.append(moment, 0.0)
stiffness = np.append(stiffness, KT - stiffness.sum())
limit[-1] = FS - moment.sum()

time = np.arange(1, 241) / 80
displacement = 1e-6 * np.round(1e6 * (12 + 28 * time) * 1e-6 * np.sin(2 * np.pi * time), 2)
held, before, force = np.zeros(stiffness.size), 0.0, []
for u in displacement:
    # 20 substeps, so that the sliders follow the turning points
    for step in np.linspace(before, u, 21)[1:]:
        held = np.clip(held + stiffness * (step - before), -limit, limit)
        before = step
    force.append(held.sum() + FLEXURE * u)
force += 4.0 * np.random.default_rng(5).standard_normal(len(force))
rows = np.c_[1e6 * displacement, force]
np.savetxt("friction_rig.csv", rows, fmt=["%.2f", "%.1f"], delimiter=",", header="displacement_um,force_N", comments="")

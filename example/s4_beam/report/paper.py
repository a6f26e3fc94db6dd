"""The paper's numbers (arXiv 2603.26446; CC BY 4.0). SI units, wall times in s."""

LINEAR = {"in-phase": 211.67, "out-of-phase": 253.70}   # Hz, table 3, multi-scale
LIMITS = {"QSMA": 209.16, "EPMC": 209.52, "ring-down": 213.19, "flat": 216.74}  # Hz, figures 7 to 9; flat: Abaqus
FULL_FE_RINGDOWN = 210.37                               # Hz, figure 9
DAMPING = 1e-3                                          # where it levels out
DROP, DROP_AMPLITUDE = 0.01, 0.14e-3                    # the frequency falls by less up to this amplitude, m
PEAK = 0.13e-3                                          # m, high impact, section 3.5
SLIP = {"high": (1.69e-6, 0.25e-6), "super-high": (43.8e-6, 8.79e-6)}  # m, largest and residual, section 3.5
STATIC_SHIFT = 50e-6                                    # m, super-high impact
SETTLED = 0.3                                           # s after an impact nearly all points stick
ALIKE = 0.005                                           # what we call the same: three ways to a resonance, repeated impacts

# Intel i9-13900K, 24 threads; table 2, sections 3.1 and 3.5, appendix B
WALL = {"reduction": 140.0, "contact matrices": 70.0, "preload": 74.0, "qsma": 107.0, "ringdown per ms": 20.0,
        "settling": 2.0 * 86400.0, "stepped": 9.7 * 86400.0, "swept": 5.46 * 86400.0}
SIMULATED = {"settling": 7.0, "stepped": 42.0, "swept": 23.6}  # s

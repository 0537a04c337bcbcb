"""What Schlegel, Neubert and Protzel measured: the line of dimensions against k, and repeated unbinding.

Raw results of the authors' public toolbox: the first number of dimensions on their grid with a mean accuracy of at
least .99 over 10 repetitions, N = 1,000 items, k = 3 to 51, all k bundled in one step and normalised once. The lines
were fitted to those by least squares.

Source: Schlegel, Neubert and Protzel 2022, "A comparison of vector symbolic architectures", Artificial Intelligence
Review 55, arXiv 2001.11797.
"""

from __future__ import annotations

LINES = {
    "bundle": {
        "MAP-B": (50.4, 36.9),
        "MAP-C uniform": (44.3, -27.2),
        "MAP-I": (31.8, -2.8),
        "HRR": (31.8, 37.7),
        "FHRR": (22.0, 3.1),
        "VTB": (30.9, 39.9),
        "MBAT": (33.5, -24.9),
        "BSC": (47.9, 33.6),
        "BSDC-S": (21.3, 5.1),
    },
    "pairs": {
        "MAP-B": (49.3, 40.2),
        "MAP-C uniform": (41.8, -4.8),
        "MAP-I": (32.4, 7.2),
        "HRR": (34.1, 4.3),
        "FHRR": (21.7, 14.1),
        "VTB": (32.7, 58.0),
        "MBAT": (35.1, 42.3),
        "BSC": (49.9, 1.2),
        "BSDC-S": (33.5, 62.3),
    },
}
"""Slope and intercept of the dimensions needed for k atoms in a bundle, and for k bound pairs."""

EXACT = (1.0, 1.0, 1.0, 1.0)
RETURNED = {
    "MAP-C uniform": (0.74, 0.55, 0.22, 0.08),
    "HRR": (0.71, 0.49, 0.21, 0.09),
    "VTB": (0.71, 0.58, 0.41, 0.33),
    **dict.fromkeys(("MAP-B", "MAP-I", "FHRR", "BSC", "BSDC-S"), EXACT),
}
"""The similarity to the original after binding with 1, 2, 5 and 10 keys and unbinding again, d = 1,024."""
STEPS = (1, 2, 5, 10)

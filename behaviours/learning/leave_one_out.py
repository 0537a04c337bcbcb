"""The error of a ridge regression on each row, learned from all others."""

import torch
from jaxtyping import Float64, Shaped
from torch import Tensor

from behaviours.learning.ridge import RIDGES
from torchvsa._numerics import as_bipolar


def leave_one_out_error(
    conditions: Shaped[Tensor, "k d"], targets: Float64[Tensor, "k m"], weights: Float64[Tensor, "k"]
) -> float:
    """The smallest mean squared error, over `RIDGES`, of rows that the program was not fitted to.

    One program for each of m targets is fitted to all rows but one, which is asked; all k times at once, since the
    error is a quotient of the solution and the diagonal of the inverse of the system. A row of weight w counts w times.
    Takes k² memory and k³ time.

    Source: Allen 1974, "The relationship between variable selection and data augmentation" (PRESS), in the dual form.
    """
    rows = as_bipolar(conditions).float()
    kernel = (rows @ rows.T).double() / rows.shape[1]
    errors = []
    for ridge in RIDGES:
        system = kernel.clone()
        system.diagonal().add_(ridge / weights)
        factor, failed = torch.linalg.cholesky_ex(system)
        if failed:
            break
        inverse = torch.cholesky_inverse(factor)
        residuals = inverse @ targets / inverse.diagonal()[:, None]
        errors.append(float((residuals.square().mean(1) * weights).sum() / weights.sum()))
    return min(errors)

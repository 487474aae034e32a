"""What a fitted model foretells of runs that it was not fitted to, as well as it can."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..calibrate.differences import jacobian
from ..calibrate.known import STEP
from .linear import SampleStack
from .models import Fitted

Vector = NDArray[np.float64]


def foretold(fitted: Fitted, residual: Vector, stack: SampleStack) -> Vector:
    """Residuals of runs that were not fitted, white of what the parameters' deviations add.

        C^(-1/2) r,    C = 1 + S P S'

    with derivatives S of the model over the noise and the covariance P of the parameters: a model
    that is right is off by S dp there, which is slow (a speed's error is an angle's drift).

    Args:
        fitted: the model.
        residual: over the noise, in the runs of the stack.
        stack: of these runs.

    Raises:
        CosimError: it cannot be simulated beside its parameters.
    """
    scale = fitted.problem.scale
    theta = fitted.estimate.theta
    slopes = jacobian(fitted.simulator, theta, stack.names, central=False, relative=STEP)
    values, vectors = np.linalg.eigh(fitted.estimate.covariance / np.outer(scale, scale))
    deviations = vectors * np.sqrt(np.maximum(values, 0.0))
    ways, sizes, _ = np.linalg.svd(stack.matrix(slopes, scale) @ deviations, full_matrices=False)
    taken = 1.0 - 1.0 / np.sqrt(1.0 + sizes**2)
    return np.asarray(residual - ways @ (taken * (ways.T @ residual)))

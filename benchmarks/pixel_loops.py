"""`l1` and `sbl` as people write them: a loop over pixels around numpy.linalg. The reference of bench_solve.

The same weights, floors and tolerances as solve/pixelwise/l1.py and solve/pixelwise/sbl.py; no shadow threshold, so
that both see the same samples.
"""

import numpy as np


def l1_loop(samples, directions, *, residual_floor, tolerance, iterations):
    """Return b (P, 3) by reweighted least squares, samples (P, F) in units of the scale."""
    found = np.zeros((len(samples), 3))
    for i, m in enumerate(samples):
        b = np.linalg.lstsq(directions, m, rcond=None)[0]
        for _ in range(iterations):
            root = np.sqrt(1 / np.maximum(np.abs(m - directions @ b), residual_floor))
            new = np.linalg.lstsq(root[:, None] * directions, root * m, rcond=None)[0]
            moved = np.abs(new - b).sum()
            b = new
            if moved < tolerance:
                break
        found[i] = b
    return found


def sbl_loop(samples, directions, *, prior, residual_floor, tolerance, iterations):
    """Return b (P, 3) by sparse Bayesian regression, samples (P, F) in units of the scale."""
    found = np.zeros((len(samples), 3))
    for i, m in enumerate(samples):
        inverse = np.ones(len(m))
        b = np.linalg.lstsq(directions, m, rcond=None)[0]
        for _ in range(iterations):
            covariance = np.linalg.inv(directions.T @ np.diag(inverse) @ directions + prior * np.eye(3))
            spread = np.diag(directions @ covariance @ directions.T)
            inverse = 1 / np.maximum((m - directions @ b) ** 2 + spread, residual_floor**2)
            weights = np.diag(inverse)
            new = np.linalg.solve(directions.T @ weights @ directions, directions.T @ weights @ m)
            moved = np.abs(new - b).sum()
            b = new
            if moved < tolerance:
                break
        found[i] = b
    return found

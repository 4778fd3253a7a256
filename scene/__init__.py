"""Ground floor: the types that every step speaks, their units and axes. numpy only."""

import os

# rgbn's matrices are small, and it shares out the cores itself, by frames and bands: OpenBLAS's own threads only wait
# for each other, which cost calibrate two thirds more CPU time. Read when numpy is loaded, so set before: the upper
# floors import this package first.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

"""Top floor: one function per verb, the command line, resuming."""

import os

# rgbn's matrices are small, and it shares out the cores itself, by frames and bands: OpenBLAS's own threads only wait
# for each other, which cost calibrate two thirds more CPU time. Read when numpy is loaded, so set before.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

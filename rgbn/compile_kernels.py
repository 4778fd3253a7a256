"""Run by `make setup`: every method and the twin once, so that the compiled kernels lie in numba's cache.

Otherwise the first session and the first tests would wait for the compiler.
"""

import sys
from tempfile import TemporaryDirectory

import rgbn
from rgbn.examples import fixture_folder
from solve.methods import METHODS


def compile_kernels() -> None:
    """Take the demo session the whole way, by every method; nothing of it is kept but the compiled kernels."""
    with TemporaryDirectory(prefix="rgbn-") as folder:
        run = rgbn.open(fixture_folder(), out=f"{folder}/out")
        run.process(",".join(METHODS), rgbn.TwinSettings(engine="many", error=0.05))


if __name__ == "__main__":
    try:
        compile_kernels()
    except Exception as error:
        print(f"not compiled beforehand, so the first run will be slower: {error}", file=sys.stderr)

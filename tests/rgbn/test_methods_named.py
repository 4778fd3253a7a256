"""The command line names every method; its help may not load the solvers to find out."""

from typing import get_args

from rgbn.cli import Method
from solve.solve import METHODS


def test_the_help_lists_the_methods_that_there_are():
    text = get_args(Method)[1].help
    assert text.rstrip(".").split(": ")[1].split(", ") == list(METHODS)

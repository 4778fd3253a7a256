"""The command line names every method; its help may not load the solvers to find out."""

from typing import get_args, get_type_hints

from lab.options import Solving
from solve.methods import METHODS


def test_the_help_lists_the_methods_that_there_are():
    text = get_args(get_type_hints(Solving, include_extras=True)["method"])[1].help
    assert text.split(": ")[1].split(". ")[0].split(", ") == list(METHODS)

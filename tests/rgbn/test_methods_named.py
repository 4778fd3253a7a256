"""The command line names every method and every format; its help may not load them to find out."""

from typing import get_args, get_type_hints

import pytest

from lab.options import Solving, TwinSettings, named
from rgbn.export_command import FORMATS, export
from scene.errors import SceneError
from solve.methods import METHODS


@pytest.mark.parametrize(("verb", "option", "known"), [(Solving, "method", METHODS), (export, "format", FORMATS)])
def test_the_help_lists_what_there_is(verb, option, known):
    text = get_args(get_type_hints(verb, include_extras=True)[option])[1].help
    assert text.split(": ")[1].split(". ")[0].split(", ") == list(known)


def test_names_are_read_in_any_case_and_each_once():
    assert Solving("LS,Iterative, ls").methods() == ("ls", "iterative")
    assert named("--on", "net,TWO", ("Net", "two")) == ("Net", "two")
    for text, unknown in (("ls,magic", "magic is unknown"), (" , ", "nothing is unknown")):
        with pytest.raises(SceneError, match=unknown) as caught:
            Solving(text).methods()
        assert "there are ls, iterative," in str(caught.value)
    with pytest.raises(SceneError, match="--engine fast: fast is unknown; there are auto, many"):
        TwinSettings(engine="fast")

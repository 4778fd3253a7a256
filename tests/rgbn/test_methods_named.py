"""The command line names every method and every format; its help may not load them to find out."""

from typing import get_args, get_type_hints

import pytest

from formats.light_files.light_formats import FORMATS as KNOWN
from lab.options import Solving, TwinSettings, named
from rgbn.export_command import FORMATS, LIGHTS
from scene.errors import SceneError
from solve.methods import METHODS


def test_the_help_lists_the_methods_that_there_are():
    text = get_args(get_type_hints(Solving, include_extras=True)["method"])[1].help
    assert text.split(": ")[1].split(". ")[0].split(", ") == list(METHODS)


def test_every_format_of_lights_can_be_exported():
    assert set(LIGHTS) == set(KNOWN)
    assert {*LIGHTS} < {*FORMATS}


def test_names_are_read_in_any_case_and_each_once():
    assert Solving("LS,Iterative, ls").methods() == ("ls", "iterative")
    assert named("--on", "net,TWO", ("Net", "two")) == ("Net", "two")
    for text, unknown in (("ls,magic", "magic is unknown"), (" , ", "nothing is unknown")):
        with pytest.raises(SceneError, match=unknown) as caught:
            Solving(text).methods()
        assert "there are ls, iterative," in str(caught.value)
    with pytest.raises(SceneError, match="--engine fast: fast is unknown; there are auto, many"):
        TwinSettings(engine="fast")

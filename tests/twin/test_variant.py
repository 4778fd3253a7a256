"""The choice of Mitsuba's variant: the newest LLVM that renders, asked once."""

import json
import os
import re
import sys
from pathlib import Path

import pytest

from twin.engines import variant


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """A machine with the LLVM libraries 15, 17 and 19, a fresh cache, and a probe that tells what it was asked."""
    place = tmp_path / "lib"
    place.mkdir()
    for name in ("libLLVM-15.so", "libLLVM-17.so.1", "libLLVM.so.19.1", "libLLVM.so"):
        (place / name).write_text(name)
    (place / "libLLVM-19.so").symlink_to(place / "libLLVM.so.19.1")
    monkeypatch.setattr(variant, "_PLACES", (str(place / "libLLVM*.so*"),))
    monkeypatch.setattr(variant, "_cache_folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(variant, "_has", lambda name: True)
    monkeypatch.setattr(variant, "graphics_card", lambda: "")
    monkeypatch.setenv(variant.ASKED, "yes")
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "nowhere"))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    asked = []

    def probe(name, library=None):
        asked.append(name if library is None else library.name)
        return probe.card if library is None else probe.works(library)

    probe.card, probe.works = True, lambda library: True
    monkeypatch.setattr(variant, "_probe", probe)
    return probe, asked


def test_the_newest_is_asked_first_once_and_the_old_one_never(machine):
    _, asked = machine
    name, note = variant.pick_variant()
    assert name == "llvm_ad_rgb"
    assert os.environ["DRJIT_LIBLLVM_PATH"] in note
    os.environ.pop("DRJIT_LIBLLVM_PATH")
    assert variant.pick_variant() == (name, note)
    assert asked == ["libLLVM-19.so"]


def test_one_that_aborts_gives_way_to_the_next(machine):
    probe, asked = machine
    probe.works = lambda library: "17" in library.name
    assert variant.pick_variant()[0] == "llvm_ad_rgb"
    assert asked == ["libLLVM-19.so", "libLLVM-17.so.1"]
    assert os.environ.pop("DRJIT_LIBLLVM_PATH").endswith("libLLVM-17.so.1")


def test_without_one_that_works_the_scalar_variant_says_how_to_get_the_fast_one(machine):
    probe, _ = machine
    probe.works = lambda library: False
    name, note = variant.pick_variant()
    assert name == "scalar_rgb"
    assert "apt install libllvm" in note
    assert "DRJIT_LIBLLVM_PATH" not in os.environ


def test_a_library_that_the_user_names_is_the_only_one_asked(machine, monkeypatch, tmp_path):
    _, asked = machine
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "lib" / "libLLVM-17.so.1"))
    assert variant.pick_variant()[0] == "llvm_ad_rgb"
    assert asked == ["libLLVM-17.so.1"]
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "absent.so"))
    assert variant.pick_variant()[0] == "scalar_rgb"


def test_a_spoilt_cache_costs_a_probe_and_nothing_else(machine, tmp_path):
    _, asked = machine
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "mitsuba_llvm.json").write_text("{not json")
    assert variant.pick_variant()[0] == "llvm_ad_rgb"
    os.environ.pop("DRJIT_LIBLLVM_PATH")
    assert len(json.loads((tmp_path / "cache" / "mitsuba_llvm.json").read_text())) == len(asked) == 1


def test_a_card_that_renders_is_taken_first_and_asked_once(machine, monkeypatch):
    _, asked = machine
    monkeypatch.setattr(variant, "graphics_card", lambda: "H100, 550.1")
    for _ in range(2):
        assert variant.pick_variant() == ("cuda_ad_rgb", "on H100, 550.1")
    assert asked == ["cuda_ad_rgb"]
    # Another driver is another question.
    monkeypatch.setattr(variant, "graphics_card", lambda: "H100, 560.2")
    assert variant.pick_variant()[0] == "cuda_ad_rgb"
    assert asked == ["cuda_ad_rgb"] * 2


def test_a_card_that_renders_otherwise_gives_way_to_llvm_with_a_line(machine, monkeypatch):
    probe, asked = machine
    probe.card = False
    monkeypatch.setattr(variant, "graphics_card", lambda: "H100, 550.1")
    name, note = variant.pick_variant()
    assert name == "llvm_ad_rgb"
    assert note.startswith("H100, 550.1 does not render as the processor does")
    assert asked == ["cuda_ad_rgb", "libLLVM-19.so"]


def test_a_card_that_nobody_asks_for_is_left_alone(machine, monkeypatch):
    _, asked = machine
    monkeypatch.setattr(variant, "graphics_card", lambda: "H100, 550.1")
    monkeypatch.delenv(variant.ASKED)
    name, note = variant.pick_variant()
    assert name == "llvm_ad_rgb"
    assert "RGBN_GPU=yes" in note
    assert asked == ["libLLVM-19.so"]


@pytest.mark.render
def test_the_probe_compares_with_the_scalar_variant(monkeypatch):
    assert variant._probe(variant.SLOW)
    monkeypatch.setattr(variant, "_PROBE", variant._PROBE.replace("mean(sys.argv[1])", "1.03 * mean(sys.argv[1])"))
    assert variant._probe(variant.SLOW) is False


def test_no_code_but_this_names_a_variant():
    root = Path(variant.__file__).parents[2]
    rooms = [folder for folder in root.iterdir() if (folder / "__init__.py").exists() and folder.name != "tests"]
    assert len(rooms) > 8
    # `mitsuba -m llvm_ad_rgb` is a command line that is shown to people.
    quoted = re.compile(r"""["'](llvm|cuda|scalar)_(ad_)?rgb["']""")
    named = {file.name for room in rooms for file in room.rglob("*.py") if quoted.search(file.read_text())}
    assert named == {"variant.py"}

"""The choice of Mitsuba's variant: the newest LLVM that renders, asked once."""

import json
import os
import sys

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
    yield probe, asked
    os.environ.pop("DRJIT_LIBLLVM_PATH", None)


def test_the_newest_is_asked_first_and_once_whatever_the_cache_holds(machine, tmp_path):
    _, asked = machine
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "mitsuba_llvm.json").write_text("{not json")
    name, note = variant.pick_variant()
    assert name == "llvm_ad_rgb"
    assert os.environ.pop("DRJIT_LIBLLVM_PATH") in note
    assert variant.pick_variant() == (name, note)
    assert asked == ["libLLVM-19.so"]
    assert len(json.loads((tmp_path / "cache" / "mitsuba_llvm.json").read_text())) == 1


@pytest.mark.parametrize(("works", "taken"), [("17", "libLLVM-17.so.1"), ("none", None)])
def test_one_that_aborts_gives_way_to_the_next_and_the_last_to_the_scalar_variant(machine, works, taken):
    probe, asked = machine
    probe.works = lambda library: works in library.name
    name, note = variant.pick_variant()
    assert asked[:2] == ["libLLVM-19.so", "libLLVM-17.so.1"], "the old one never"
    assert name == ("llvm_ad_rgb" if taken else "scalar_rgb")
    assert ("apt install libllvm" in note) == (taken is None)
    assert os.environ.get("DRJIT_LIBLLVM_PATH", "None").endswith(str(taken))


def test_a_library_that_the_user_names_is_the_only_one_asked(machine, monkeypatch, tmp_path):
    _, asked = machine
    for file, name in (("libLLVM-17.so.1", "llvm_ad_rgb"), ("absent.so", "scalar_rgb")):
        monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(tmp_path / "lib" / file))
        assert variant.pick_variant()[0] == name
    assert asked == ["libLLVM-17.so.1"]


def test_a_card_is_taken_where_it_is_asked_for_and_renders_and_is_asked_once(machine, monkeypatch):
    probe, asked = machine
    monkeypatch.setattr(variant, "graphics_card", lambda: "H100, 550.1")
    for _ in range(2):
        assert variant.pick_variant() == ("cuda_ad_rgb", "on H100, 550.1")
    assert asked == ["cuda_ad_rgb"]
    # Another driver is another question.
    monkeypatch.setattr(variant, "graphics_card", lambda: "H100, 560.2")
    probe.card = False
    name, note = variant.pick_variant()
    assert (name, asked[1:]) == ("llvm_ad_rgb", ["cuda_ad_rgb", "libLLVM-19.so"])
    assert note.startswith("H100, 560.2 does not render as the processor does")
    monkeypatch.delenv(variant.ASKED)
    monkeypatch.setattr(variant, "graphics_card", lambda: "H100, 570.3")
    assert "RGBN_GPU=yes" in variant.pick_variant()[1]
    assert asked.count("cuda_ad_rgb") == 2


@pytest.mark.render
def test_the_probe_compares_with_the_scalar_variant(monkeypatch):
    assert variant._probe(variant.SLOW)
    monkeypatch.setattr(variant, "_PROBE", variant._PROBE.replace("mean(sys.argv[1])", "1.03 * mean(sys.argv[1])"))
    assert variant._probe(variant.SLOW) is False

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
    monkeypatch.setattr(variant, "_has_fast_variant", lambda: True)
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "nowhere"))
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    asked = []

    def probe(library):
        asked.append(library.name)
        return probe.works(library)

    probe.works = lambda library: True
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


@pytest.mark.render
def test_a_probe_that_dies_is_a_no(tmp_path):
    (tmp_path / "libLLVM-99.so").write_bytes(b"no library")
    assert variant._probe(tmp_path / "libLLVM-99.so") is False

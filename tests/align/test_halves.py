"""Poses from half of the flashes and of the outline, each alone."""

from dataclasses import replace

import numpy as np
import pytest

from align.pose.full_resolution import FinalEvidence, ObservedObject
from align.pose.halves import cross_validate
from align.pose.outline_edges import EdgePictures
from scene.rays import RayCaster


@pytest.fixture(scope="module")
def evidence_under(world):
    def under(lights, photographs=world.photographs):
        pictures = EdgePictures.of(photographs)
        seen = ObservedObject.of(
            RayCaster(world.mesh), replace(photographs, lights=lights), pictures, count=1500, cells=100
        )
        return FinalEvidence(seen, world.pose, 4.0)

    return under


def test_halves_agree_under_right_lights_and_not_where_every_second_light_is_off(world, evidence_under):
    right = cross_validate(evidence_under(world.lights))
    # Every second flash told too far to the right.
    shift = np.where(np.arange(len(world.lights)) % 2 == 1, 60.0, 0.0)[:, None] * [1.0, 0.0, 0.0]
    wrong = cross_validate(evidence_under(replace(world.lights, positions_mm=world.lights.positions_mm + shift)))
    assert right.ratio < 1
    assert right.difference_deg < right.stated_deg
    assert wrong.difference_deg > 2 * right.difference_deg
    assert wrong.ratio > 2 * right.ratio


def test_too_few_flashes_for_two_halves_tell_nothing(world, evidence_under):
    few = np.arange(7)
    frames, lights = world.frames.only(few), world.lights.only(few)
    photographs = replace(world.photographs, frames=frames, lights=lights)
    assert cross_validate(evidence_under(lights, photographs)) is None


def test_halves_of_the_outline_share_no_edge_and_leave_none_out(world):
    pictures = EdgePictures.of(world.photographs)
    evidence = FinalEvidence(
        ObservedObject.of(RayCaster(world.mesh), world.photographs, pictures, count=200, cells=100), world.pose, 4.0
    )
    outline = evidence.outline
    found = [
        np.isfinite(replace(pictures, half=half).locate(outline.pixels, outline.outward, reach_px=4.0))
        for half in (0, 1, None)
    ]
    assert not (found[0] & found[1]).any()
    assert ((found[0] | found[1]) == found[2]).all()
    assert min(found[0].sum(), found[1].sum()) > 0.3 * found[2].sum()

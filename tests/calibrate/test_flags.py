"""Flags of lights: many frames are one sentence."""

from calibrate.calibration import flag_warnings

NAMES = tuple(f"flash_{i:03d}" for i in range(12))
ORDER = "taken in the file's order: its names are not the frames'"


def test_many_frames_are_one_sentence_with_what_to_do():
    (all_of_them,) = flag_warnings(NAMES, [(ORDER,)] * 12)
    assert all_of_them.startswith(f"lights, all 12: {ORDER}. If the photographs are in another order")
    (some,) = flag_warnings(NAMES, [(ORDER,)] * 7 + [()] * 5)
    assert "flash_000, flash_001, flash_002, flash_003, flash_004 and 2 more" in some


def test_a_kind_that_a_few_frames_may_have_is_a_warning_from_a_quarter_on():
    flag = "glare beside the highlight on chrome ball 2: the middle of its core is taken"
    assert not flag_warnings(NAMES, [(flag,)] * 2 + [()] * 10)
    assert flag_warnings(NAMES, [(flag,)] * 3 + [()] * 9)


def test_flags_that_a_file_brings_are_told_as_its_own():
    (told,) = flag_warnings(NAMES, [("dim",)] + [()] * 11)
    assert "flash_000 (dim)" in told

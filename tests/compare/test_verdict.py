"""The verdict follows the numbers: no praise that they do not carry, no silence about what is missing."""

import copy
from typing import Any

import pytest

from compare.report.advice import advice, limits
from compare.report.page import plain
from compare.report.report import write_report
from compare.report.verdict import ranking, verdict


def statistics(median: float) -> dict[str, Any]:
    return {"median_deg": median, "q3_deg": 2 * median, "under_10_deg": 0.8, "under_5_deg": 0.5, "pixels": 1000}


def summary_of(median: float = 2.0, twin: float = 1.8, pearson: float = 0.9) -> dict[str, Any]:
    return {
        "calibrate": {"model": "near", "direction_sigma_deg_median": 0.2, "intensity_sigma_median": 0.01},
        "align": {"residual_px": 0.5, "sigma_deg": 0.1},
        "camera": {"projection": "perspective", "source": "session.toml"},
        "capture": {"ambient": True},
        "compare": {
            "has_truth": True,
            "truth": {"pixels": 1000, "sigma_deg_median": 0.3},
            "lights": {"count": 12, "model": "near", "frames": []},
            "methods": {
                "ls": {
                    "real": statistics(median),
                    "twin": statistics(twin),
                    "coverage": 1.0,
                    "pearson": pearson,
                    "spearman": pearson,
                    "median_difference_deg": median - twin,
                    "real_rotation_deg": 0.1,
                    "real_median_unrotated_deg": median,
                }
            },
        },
    }


def levels(summary: dict[str, Any]) -> dict[str, str]:
    return {statement.topic: statement.level for statement in verdict(summary)}


def text_of(summary: dict[str, Any], topic: str) -> str:
    return next(statement.text for statement in verdict(summary) if statement.topic == topic)


@pytest.mark.parametrize(("median", "level"), [(5.04, "good"), (5.1, "care"), (10.0, "care"), (10.1, "bad")])
def test_the_median_error_decides_on_the_normals(median, level):
    assert levels(summary_of(median, median))["Normals"] == level
    assert f"{median:.1f}°" in text_of(summary_of(median, median), "Normals")


def test_a_twin_that_fails_alike_but_much_less_is_not_called_good_and_what_it_has_it_does_not_lack():
    assert levels(summary_of(4.5, 1.0))["Twin"] == "care"
    assert "(noise, material, errors of" in text_of(summary_of(4.5, 1.0), "Twin")
    fitted = summary_of(4.5, 1.0) | {"twin": {"material": {"relative_rmse": 0.0123}, "sensor": {"iso": 100}}}
    assert "(the 1.2 % that its material leaves unexplained, errors of" in text_of(fitted, "Twin")


@pytest.mark.parametrize(
    ("part", "key", "value", "topic", "level"),
    [
        ("ls", "pearson", 0.5, "Twin", "care"),
        ("ls", "pearson", 0.1, "Twin", "bad"),
        ("ls", "pearson", -0.8, "Twin", "bad"),
        ("align", "residual_px", 2.0, "Ground truth", "care"),
        ("align", "residual_px", 9.0, "Ground truth", "bad"),
        ("calibrate", "direction_sigma_deg_median", 2.0, "Lights", "care"),
        ("calibrate", "direction_sigma_deg_median", 9.0, "Lights", "bad"),
        ("calibrate", "direction_sigma_deg_median", None, "Lights", "unknown"),
        ("camera", "projection", "orthographic", "Camera", "care"),
        ("camera", "source", "EXIF", "Camera", "care"),
        ("capture", "ambient", False, "Ambient light", "care"),
    ],
)
def test_each_number_moves_its_own_topic(part, key, value, topic, level):
    summary = summary_of()
    (summary["compare"]["methods"] if part == "ls" else summary)[part][key] = value
    found = levels(summary)
    assert found.pop(topic) == level
    # What a poor truth measured is not called good either.
    assert found.pop("Normals") == ("care" if (topic, level) == ("Ground truth", "bad") else "good")
    assert set(found.values()) == {"good"}


def test_few_answers_suspicious_lights_an_uncertain_truth_and_a_common_tilt_lower_the_level():
    summary = summary_of(0.5, 0.5)
    row = summary["compare"]["methods"]["ls"]
    row |= {"coverage": 0.4, "real_rotation_deg": 1.9, "real_median_unrotated_deg": 0.1}
    summary["compare"]["lights"]["frames"] = [{"name": "flash_3", "flags": ["weak"]}]
    found = levels(summary)
    assert {topic for topic, level in found.items() if level == "care"} == {"Normals", "Lights", "Common tilt"}
    assert "40\u202f%" in text_of(summary, "Normals")
    assert "flash_3" in text_of(summary, "Lights")
    assert "the truth's own" in text_of(summary, "Ground truth")


def test_the_first_screen_says_why_or_that_nothing_tells_and_no_comfort_beside_what_is_marked(session):
    def why(summary):
        return plain(limits(summary, verdict(summary)))

    def first(summary):
        page = write_report(session.store, summary).read_text("utf-8")
        return plain(page[page.index('<section id="verdict"') : page.index('<section id="viewer"')])

    assert "rendered twin fails at the same pixels" in why(summary_of())
    assert "No step gave a warning" in first(summary_of())
    bare = summary_of()
    del bare["compare"]["methods"]["ls"]["twin"]
    assert "Nothing here tells" in why(bare)
    bare["compare"]["methods"]["ls"] |= {"real_rotation_deg": 4.0, "real_median_unrotated_deg": 0.5}
    assert "One turn common to all normals" in why(bare)
    assert "take care Common tilt" in first(bare)
    assert "No step gave a warning" not in first(bare)
    bare["warnings"] = [{"step": "calibrate", "text": "a"}, {"step": "twin", "text": "b"}]
    assert why(bare).endswith("The lights are doubtful, and may have a part in it.")
    assert "2 warnings:" in first(bare)
    bare["compare"] = {"has_truth": False}
    assert "Nothing independent was given" in why(bare)


def test_without_truth_nothing_is_called_good_and_disagreement_is_told():
    summary = summary_of()
    del summary["align"]
    summary["compare"] = {
        "has_truth": False,
        "methods": {"ls": {"real": None, "twin": None}, "hsh": {"real": None, "twin": None}},
        "between_methods": [{"a": "ls", "b": "hsh", "median_deg": 8.5, "q3_deg": 20.25, "pixels": 9}],
        "lights": {"count": 12, "model": "near", "frames": []},
    }
    assert levels(summary) == {"Normals": "unknown", "Lights": "good"}
    assert "8.5°" in text_of(summary, "Normals")


def test_methods_are_ranked_by_their_median_and_names_stay_text():
    summary = summary_of(6.0, 6.0)
    summary["compare"]["methods"]["<i>tv"] = copy.deepcopy(summary_of(3.0, 3.0)["compare"]["methods"]["ls"])
    summary["compare"]["methods"] |= {"b": {"real": None}, "a": {}}
    ranked = [(row["name"], row["level"]) for row in ranking(summary)]
    assert ranked == [("<i>tv", "good"), ("ls", "care"), ("b", "unknown"), ("a", "unknown")]
    assert levels(summary)["Normals"] == "good"
    assert "<i>tv." in text_of(summary, "Normals")
    assert all("<i>" not in each.html for each in verdict(summary))
    assert ranking({}) == []


def test_a_method_that_doubts_itself_is_not_good_and_its_doubt_stands_beside_it():
    summary = summary_of()
    summary["solve"] = {"methods": {"ls": {"warnings": ["ls: three `lights` only"]}}}
    assert levels(summary)["Normals"] == "care"
    assert "three lights only" in text_of(summary, "Normals")
    assert ranking(summary)[0]["doubts"] == "three lights only"
    summary["compare"]["methods"]["ls"]["real"]["median_deg"] = 30.0
    assert levels(summary)["Normals"] == "bad"


@pytest.mark.parametrize(
    ("step", "text", "topic", "word"),
    [
        ("calibrate", "one chrome ball: the lights' positions rest on it alone", "Lights", "the calibration warned"),
        ("check", "flash_004: moved by 3.1 px against the others", "Lights", "the check warned"),
        ("align", "mask: 12 % of the object was not scanned", "Ground truth", "the registration warned"),
    ],
)
def test_a_warning_lowers_the_result_of_its_step_and_no_other_and_never_lifts_one(step, text, topic, word):
    summary = summary_of()
    summary["warnings"] = [
        {"step": step, "text": text},
        {"step": "check", "text": "camera: focal length from EXIF"},
        {"step": "twin", "text": "few samples"},
    ]
    found = levels(summary)
    assert found.pop(topic) == "care"
    assert set(found.values()) == {"good"}
    assert next(one.reasons for one in verdict(summary) if one.topic == topic) == (word,)
    summary["calibrate"]["direction_sigma_deg_median"] = 9.0
    assert levels(summary)["Lights"] == "bad"


@pytest.mark.parametrize(("share", "word", "level"), [(0.93, "pass", "good"), (0.61, "fail", "bad")])
def test_a_tolerance_is_passed_or_not_and_is_said_first(share, word, level):
    summary = summary_of()
    found = {"deg": 3.0, "method": "ls", "share": share, "least_share": 0.9, "passes": share >= 0.9}
    summary["compare"]["tolerance"], summary["arguments"] = found, {"tolerance_deg": 3.0}
    first = verdict(summary)[0]
    assert (first.topic, first.word, first.level) == ("Tolerance", word, level)
    assert f"{share:.1%}".replace("%", "\u202f%") in first.text
    # Whatever the usual bars say: no page says "pass" and "do not rely on it", or "fail" and "good".
    methods = summary_of(*[2.0 if word == "fail" else 12.0] * 2)["compare"]["methods"]
    methods["ls"]["real_within_tolerance"] = share
    assert levels({**summary, "compare": {**summary["compare"], "methods": methods}})["Normals"] == level
    # A truth that is less sure than half of the tolerance cannot tell it.
    far = summary_of(12.0, 12.0)["compare"]["methods"]
    unsure = summary["compare"] | {"methods": far, "truth": {"sigma_deg_median": 1.6}}
    assert "or of the tolerance" in next(
        one.text for one in verdict(summary | {"compare": unsure}) if one.topic == "Ground truth"
    )
    # A tolerance that nothing can be held against is neither passed nor failed.
    unknown = verdict({"arguments": {"tolerance_deg": 3.0}, "compare": {"methods": {"ls": {}}}})[0]
    assert (unknown.topic, unknown.level) == ("Tolerance", "unknown")


def test_of_methods_that_are_not_told_apart_the_one_with_the_lighter_tail_stands_first():
    summary = summary_of()
    methods = summary["compare"]["methods"]
    for name, median, mean in (("ls", 2.0, 3.5), ("iterative", 2.1, 3.1), ("l1", 2.5, 2.6)):
        methods[name] = {**methods["ls"], "real": {**statistics(median), "mean_deg": mean}}
    assert [row["name"] for row in ranking(summary)] == ["ls", "iterative", "l1"]
    summary["compare"]["level"] = {"best": "ls", "level": ["iterative"]}
    assert [row["name"] for row in ranking(summary)] == ["iterative", "ls", "l1"]
    assert "with ls as good" in text_of(summary, "Normals")
    # What is said of the twin is said of the same method.
    assert "The error patterns of iterative" in text_of(summary, "Twin")


BRONZE: dict[str, Any] = {
    "warnings": [{"step": "calibrate", "text": "balls were told apart by their size"}],
    "calibrate": {"direction_sigma_deg_median": 0.24, "intensity_sigma_median": 0.007, "white_ball_deg": 2.2},
    "twin": {"material": {"relative_rmse": 0.42}},
}


@pytest.mark.parametrize(
    ("part", "key", "value", "said"),
    [
        ("calibrate", "model", "near", "The object makes the error"),
        ("calibrate", "direction_sigma_deg_median", 3.5, "the lights: they are doubtful"),
        ("calibrate", "intensity_sigma_median", 0.1, "the lights: they are doubtful"),
        ("calibrate", "white_ball_deg", 12.0, "the lights: they are doubtful"),
        ("calibrate", "cross_validation", {"difference_deg": 12.0, "stated_deg": 1.0}, "the lights: they are doubtful"),
        ("calibrate", "white_ball_deg", None, "read the warnings"),
        ("twin", "material", {"relative_rmse": 0.1}, "read the warnings"),
        ("twin", "material", {"relative_rmse": 0.1, "model": "metal"}, "The object makes the error"),
        ("align", "residual_px", 5.0, "whether the scan lies"),
        ("align", "fit", {"second_deviations": 1.0, "second_angle_deg": 40.0}, "read the warnings"),
        ("align", "fit", {"second_deviations": 9.0, "second_angle_deg": 40.0}, "The object makes the error"),
    ],
)
def test_what_makes_the_error_must_be_as_large_and_what_is_left_is_the_object(part, key, value, said):
    summary = copy.deepcopy({**summary_of(30.0, 9.0, 0.3), **BRONZE})
    summary[part][key] = value
    told = plain(advice(summary, verdict(summary)))
    assert said in told
    why = plain(limits(summary, verdict(summary)))
    assert ("--method metal" in told) == ("42\u202f%" in why or "The object is a metal" in why)


def test_an_objects_common_turn_tells_of_no_light_and_without_truth_lights_are_weighed_too():
    summary = copy.deepcopy({**summary_of(30.0, 9.0, 0.3), **BRONZE})
    summary["compare"]["methods"]["ls"] |= {"real_rotation_deg": 19.0, "real_median_unrotated_deg": 20.0}
    assert "Common tilt" not in levels(summary)
    assert "Common tilt" in levels(summary | {"twin": {}})
    trust = {"recommended": "ls", "relative_rmse": 0.3, "doubts": ["x"], "level": [], "sigma_deg": {"median": None}}
    for sigma, said in ((0.24, "known too well"), (2.5, "Look first at the lights")):
        summary["calibrate"]["direction_sigma_deg_median"] = sigma
        blind = {**summary, "trust": trust, "compare": {"has_truth": False, "methods": {"ls": {}}}}
        assert said in plain(advice(blind, verdict(blind)))

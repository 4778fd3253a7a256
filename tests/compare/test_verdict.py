"""The verdict follows the numbers: no praise that they do not carry, no silence about what is missing."""

import copy
from typing import Any

import pytest

from compare.report.first_screen import first_screen
from compare.report.page import Sentence, number, percent, plain, round_number, words
from compare.report.verdict import ranking, ranking_table, verdict


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


def test_all_is_good_when_every_number_is():
    assert set(levels(summary_of()).values()) == {"good"}


@pytest.mark.parametrize(("median", "level"), [(5.0, "good"), (5.1, "care"), (10.0, "care"), (10.1, "bad")])
def test_the_median_error_decides_on_the_normals(median, level):
    assert levels(summary_of(median, median))["Normals"] == level
    assert f"{median:.1f}°" in text_of(summary_of(median, median), "Normals")


@pytest.mark.parametrize(("pearson", "level"), [(0.9, "good"), (0.5, "care"), (0.1, "bad"), (-0.8, "bad")])
def test_the_error_patterns_decide_on_the_twin(pearson, level):
    assert levels(summary_of(pearson=pearson))["Twin"] == level


def test_a_twin_that_fails_alike_but_much_less_is_not_called_good():
    assert levels(summary_of(4.5, 1.0))["Twin"] == "care"


def test_what_a_twin_has_is_not_said_to_lack():
    told = text_of(summary_of(4.5, 1.0), "Twin")
    assert "(noise, material, errors of" in told
    fitted = summary_of(4.5, 1.0) | {"twin": {"material": {"relative_rmse": 0.0123}, "sensor": {"iso": 100}}}
    told = text_of(fitted, "Twin")
    assert "(the 1.2 % that its material leaves unexplained, errors of" in told


@pytest.mark.parametrize(
    ("part", "key", "value", "topic", "level"),
    [
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
    summary[part][key] = value
    found = levels(summary)
    assert found.pop(topic) == level
    assert set(found.values()) == {"good"}


def test_few_answers_and_suspicious_lights_lower_the_level():
    summary = summary_of()
    summary["compare"]["methods"]["ls"]["coverage"] = 0.4
    summary["compare"]["lights"]["frames"] = [{"name": "flash_3", "flags": ["weak"]}]
    assert levels(summary)["Normals"] == "care"
    assert "40\u202f%" in text_of(summary, "Normals")
    assert levels(summary)["Lights"] == "care"
    assert "flash_3" in text_of(summary, "Lights")


def test_the_scan_s_word_on_the_lights_is_told():
    summary = summary_of()
    summary["align"]["lights"] = {"off": [], "turn_deg": [0.4, 0.6, 0.5]}
    assert levels(summary)["Lights"] == "good"
    assert "contradicts none of them" in text_of(summary, "Lights")
    assert "0.5" in text_of(summary, "Lights")
    summary["align"]["lights"] = {"off": ["flash_3"], "turn_deg": [0.4, 4.6, 0.5]}
    assert levels(summary)["Lights"] == "care"
    assert "contradicts flash_3" in text_of(summary, "Lights")


def test_a_truth_as_uncertain_as_the_error_is_said_to_be_so():
    summary = summary_of(0.5, 0.5)
    assert levels(summary)["Ground truth"] == "care"
    assert "the truth's own" in text_of(summary, "Ground truth")


def test_a_common_tilt_points_to_lights_or_pose():
    summary = summary_of()
    row = summary["compare"]["methods"]["ls"]
    row["real_rotation_deg"], row["real_median_unrotated_deg"] = 1.9, 0.4
    assert levels(summary)["Common tilt"] == "care"


def why(summary, warnings=()):
    """Return what the first screen says of the cause."""
    html = first_screen(None, None, summary, list(warnings), "ls")
    return plain(html.split("<b>Why:</b>")[1].split("</p>")[0]).strip()


def test_the_first_screen_always_says_why_or_that_nothing_tells():
    assert "rendered twin fails at the same pixels" in why(summary_of())
    bare = summary_of()
    for method in bare["compare"]["methods"].values():
        del method["twin"]
    assert "Nothing here tells" in why(bare)
    bare["compare"]["methods"]["ls"] |= {"real_rotation_deg": 4.0, "real_median_unrotated_deg": 0.5}
    assert "One turn common to all normals" in why(bare)
    told = why(bare, [("calibrate", "ball 1: no highlight"), ("twin", "rough"), ("calibrate", "again")])
    assert told.endswith("There are warnings from calibrate: read them first.")
    bare["compare"] = {"has_truth": False}
    assert "Nothing independent was given" in why(bare)


def test_that_no_step_warned_is_not_said_above_what_the_verdict_marks():
    summary = summary_of()
    assert "No step gave a warning" in first_screen(None, None, summary, [], "ls")
    summary["compare"]["methods"]["ls"] |= {"real_rotation_deg": 1.9, "real_median_unrotated_deg": 0.4}
    html = first_screen(None, None, summary, [], "ls")
    assert "No step gave a warning" not in html
    assert "Common tilt" in html
    # What is counted is what is listed below the count.
    listed = first_screen(None, None, summary, [("calibrate", "a"), ("align", "b")], "ls").split("2 warnings")[1]
    assert listed.count("<li>") == 2


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
    text = text_of(summary, "Normals")
    assert "not known" in text
    assert "8.5°" in text


def test_the_best_method_is_the_one_with_the_smallest_median():
    summary = summary_of(6.0, 6.0)
    summary["compare"]["methods"]["<i>tv"] = copy.deepcopy(summary_of(3.0, 3.0)["compare"]["methods"]["ls"])
    assert levels(summary)["Normals"] == "good"
    assert [(method.name, method.level) for method in ranking(summary)] == [("<i>tv", "good"), ("ls", "care")]
    assert "<i>tv:" in text_of(summary, "Normals")
    assert all("<i>" not in html for html in [ranking_table(summary), *(each.html for each in verdict(summary))])


def test_a_method_that_doubts_itself_is_not_good_and_its_doubt_stands_beside_it():
    summary = summary_of()
    summary["solve"] = {"methods": {"ls": {"warnings": ["ls: three lights only"]}}}
    assert levels(summary)["Normals"] == "care"
    assert "three lights only" in text_of(summary, "Normals")
    assert "three lights only" in ranking_table(summary)
    summary["compare"]["methods"]["ls"]["real"]["median_deg"] = 30.0
    assert levels(summary)["Normals"] == "bad"


def test_the_truths_own_uncertainty_stands_over_the_ranking():
    assert "0.30°: methods that are level with the best are not told apart" in plain(ranking_table(summary_of()))


def test_methods_without_an_error_come_last_in_their_order():
    summary = summary_of()
    summary["compare"]["methods"] = {"b": {"real": None}, "a": {}, **summary["compare"]["methods"]}
    assert [method.name for method in ranking(summary)] == ["ls", "b", "a"]
    assert ranking({}) == []
    assert ranking_table({}) == ""


def test_every_method_has_a_word_for_who_reads_the_page():
    from solve.methods import METHODS

    assert set(words("methods")) == set(METHODS)


def test_an_empty_summary_promises_nothing():
    assert set(levels({}).values()) == {"unknown"}


@pytest.mark.parametrize(
    ("html", "text"),
    [
        (number(3.14159, 2, "°"), "3.14°"),
        (number(-0.004, 2, "px"), "−0.004\u202fpx"),
        (number(0.0, 2), "0.00"),
        (number(1234567), "1\u202f234\u202f567"),
        (number(None), "unknown"),
        (number(float("nan")), "unknown"),
        (number(True), "unknown"),
        (percent(0.123), "12\u202f%"),
        (percent(1.0), "100\u202f%"),
        (percent(0.997), "99.7\u202f%"),
        (percent(0.99999), "over 99.9\u202f%"),
        (percent(0.00001), "under 0.1\u202f%"),
    ],
)
def test_numbers_are_neither_rounded_to_nothing_nor_to_everything(html, text):
    assert plain(html) == text


@pytest.mark.parametrize(
    ("step", "text", "topic", "word"),
    [
        ("calibrate", "one chrome ball: the lights' positions rest on it alone", "Lights", "The calibration warned"),
        ("check", "flash_004: moved by 3.1 px against the others", "Lights", "The check warned"),
        ("align", "mask: 12 % of the object was not scanned", "Ground truth", "The registration warned"),
    ],
)
@pytest.mark.parametrize("nested", [False, True])
def test_nothing_is_good_beside_a_warning_of_its_step(step, text, topic, word, nested):
    summary = summary_of()
    if nested:
        summary["capture" if step == "check" else step]["warnings"] = [text]
    else:
        summary["warnings"] = [{"step": step, "text": text}]
    found = levels(summary)
    assert found.pop(topic) == "care"
    assert set(found.values()) == {"good"}
    assert f"{word}: see below." in text_of(summary, topic)


def test_a_warning_never_lifts_a_level_and_other_steps_leave_the_lights_alone():
    summary = summary_of()
    summary["warnings"] = [{"step": "calibrate", "text": "one ball"}]
    summary["calibrate"]["direction_sigma_deg_median"] = 9.0
    assert levels(summary)["Lights"] == "bad"
    summary = summary_of()
    summary["warnings"] = [
        {"step": "check", "text": "camera: focal length from EXIF"},
        {"step": "twin", "text": "few samples"},
    ]
    assert levels(summary)["Lights"] == levels(summary)["Ground truth"] == "good"


@pytest.mark.parametrize(("bar", "text"), [(1.0, "1°"), (3.0, "3°"), (0.25, "0.25°")])
def test_a_bar_has_no_more_digits_than_people_gave_it(bar, text):
    assert plain(round_number(bar, "°")) == text


def test_a_sentence_is_filled_in_escaped_and_what_is_missing_is_unknown():
    text = Sentence().vformat("{name}: {row[a]:2°}, {share:1%}, {count}, {none:2}, {row[b]:1}, {badge:html}", (), {
        "name": "<i>", "row": {"a": 1.239}, "share": 0.5, "count": 12, "badge": "<b>x</b>"
    })  # fmt: skip
    assert plain(text) == "<i>: 1.24°, 50.0\u202f%, 12, unknown, unknown, x"
    assert "<i>" not in text
    assert "<b>x</b>" in text


def test_every_sentence_and_every_table_of_the_words_can_be_filled_in_with_nothing():
    def templates(part):
        if isinstance(part, str):
            yield part
        else:
            for one in part.values() if isinstance(part, dict) else part:
                yield from templates(one)

    found = [text for text in templates(words()) if ":html}" not in text and "{:" not in text]
    assert len(found) > 100
    bars = {"alike_from": 0.3, "structured_percent": 50.0}
    for text in found:
        assert text.format(**bars) if "structured_percent" in text else Sentence().vformat(text, (), {}) or not text

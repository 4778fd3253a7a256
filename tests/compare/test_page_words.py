"""Numbers and sentences of the report: none is rounded to nothing, cut off, or taken for HTML."""

import re

import pytest
from markupsafe import Markup

from compare.report.page import Sentence, number, plain, words
from scene.method_names import METHODS


def test_every_method_has_a_word_for_who_reads_the_page():
    assert set(words("methods")) == set(METHODS)


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
        (number(0.123, 0, "%"), "12\u202f%"),
        (number(1.0, 0, "%"), "100\u202f%"),
        (number(0.997, 0, "%"), "99.7\u202f%"),
        (number(0.99999, 0, "%"), "over 99.9\u202f%"),
        (number(0.00001, 0, "%"), "under 0.1\u202f%"),
        (number(1.0, "g", "°"), "1°"),
        (number(0.25, "g", "°"), "0.25°"),
    ],
)
def test_numbers_are_neither_rounded_to_nothing_nor_to_everything(html, text):
    assert plain(html) == text


def test_a_sentence_is_filled_in_escaped_and_what_is_missing_is_unknown():
    values = {"name": "<i>", "row": {"a": 1.239}, "share": 0.5, "count": 12, "badge": Markup("<b>x</b>")}
    text = Sentence().vformat("{name}: {row[a]:2°}, {share:1%}, {count}, {none:2}, {row[b]:1}, {badge}", (), values)
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

    found = [text for text in templates(words()) if "{:" not in text]
    assert len(found) > 100
    # What stands between [[ and ]] may be left out.
    assert all(Sentence().vformat(text, (), {}) or not re.sub(r"\[\[.*?]]", "", text) for text in found)

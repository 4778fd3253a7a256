"""What each method's name stands for, in a line: who reads the report has not read the documentation."""

from typing import Any

from compare.report.facts import by_error, family

WORDS = {
    "ls": "least squares over the samples that are not in shadow; for matte surfaces.",
    "iterative": "least squares again and again, without what does not fit: gloss and cast shadows.",
    "position": "least squares over each pixel's middle samples by brightness.",
    "l1": "least absolute deviations: a few wrong samples do not steer it.",
    "sbl": "sparse Bayesian regression: each sample has a variance of its own.",
    "hsh": "hemispherical harmonics of order 2.",
    "rpca": "robust principal components: all samples as one low-rank matrix with sparse faults, then least squares.",
    "semicalibrated": "trusts the lights' directions and finds their intensities from the object; then `iterative`.",
    "near": "`iterative` and the surface's depth in turn, each flash as every pixel's place sees it.",
    "reflectance": "one table of how the whole object reflects, found together with the normals.",
    "ldr": "finds the lights too, from where a matte surface is brightest.",
    "entropy": "finds the lights too, by the relief whose albedo is plainest.",
    "tv": "finds the lights too, by the relief whose slopes balance.",
}
FAMILIES = {
    "calibrated": "is told the lights' directions and intensities.",
    "uncalibrated": "is not told the lights' directions; normals may be turned inside out or stretched as a relief.",
    "external": "another program, run by --external.",
}


def method_words(compared: dict[str, Any]) -> list[tuple[str, str]]:
    """Return, for the families and the methods that are there, what each is."""
    names = by_error(compared)
    families = {family(name) for name in names}
    return [
        *((f"{word.capitalize()} method", text) for word, text in FAMILIES.items() if word in families),
        *((name, WORDS[name].replace("`", "")) for name in names if name in WORDS),
    ]

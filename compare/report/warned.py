"""What the steps warned of, wherever the summary keeps it."""

from typing import Any


def all_warnings(summary: dict[str, Any]) -> list[tuple[str, str]]:
    """Return every warning in the summary as (step, text), each once, wherever it was put."""
    found: dict[tuple[str, str], None] = {}

    def add(step: str, texts: Any) -> None:
        for item in texts or ():
            named, text = (item.get("step", step), item.get("text", "")) if isinstance(item, dict) else (step, item)
            found.setdefault((str(named), str(text).removeprefix(f"{named}: ")))

    add("", summary.get("warnings"))
    for step, part in (("check", "capture"), *((step, step) for step in ("calibrate", "align", "twin", "compare"))):
        add(step, (summary.get(part) or {}).get("warnings"))
    for name, row in ((summary.get("solve") or {}).get("methods") or {}).items():
        add(
            "solve",
            [text if text.startswith(name) else f"{name}: {text}" for text in (row or {}).get("warnings") or ()],
        )
    return list(found)


def warned_of(summary: dict[str, Any], step: str) -> list[str]:
    """Return the warnings of one step: check, calibrate, align, solve, twin or compare."""
    return [text for named, text in all_warnings(summary) if named == step]


def doubts_of(summary: dict[str, Any], method: str) -> list[str]:
    """Return why a method says that its own result on the photographs should not be believed."""
    row = ((summary.get("solve") or {}).get("methods") or {}).get(method) or {}
    return [str(text).removeprefix(f"{method}: ") for text in row.get("warnings") or ()]

"""summary.json: every number of the report, with units in the key names."""

from datetime import UTC, datetime
from typing import Any

from lab.job import Job
from scene.current import libraries
from scene.files import write_json


def write_summary(job: Job, arguments: dict[str, Any]) -> dict[str, Any]:
    """Gather what the finished steps said, write summary.json, and return it."""
    done = job.done

    def result(step: str) -> dict[str, Any]:
        return done.get(step, {}).get("result", {})

    solved = result("solve").get("methods", {})
    twin = result("twin")
    methods = {name: {**row, "twin_seconds": twin.get("twin_seconds", {}).get(name)} for name, row in solved.items()}
    compared = dict(result("compare"))
    truth_check = compared.pop("truth_check", None)
    summary = {
        "name": job.session.name,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": libraries(),
        "arguments": arguments,
        "seconds": {step: entry["seconds"] for step, entry in done.items()},
        "warnings": [{"step": step, "text": text} for step, entry in done.items() for text in entry["warnings"]],
        "capture": result("check"),
        "camera": job.store.read_json("camera.json") if job.store.path("camera.json").exists() else None,
        "calibrate": result("calibrate"),
        "self_test": result("self_test") or None,
        "align": result("align").get("truth"),
        "solve": {"methods": methods},
        "twin": {key: value for key, value in twin.items() if key != "twin_seconds"} if twin.get("rendered") else None,
        "compare": compared,
    }
    if truth_check:
        summary["truth_check"] = truth_check
    write_json(job.store.path("summary.json"), summary)
    return job.store.read_json("summary.json")

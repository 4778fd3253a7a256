"""summary.json: every number of the report, with units in the key names; its tables for spreadsheets."""

from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from compare.statistics.statistics import statistics_rows
from lab.job import Job
from lab.plan import STEPS
from scene.current import libraries
from scene.files import remove, write_json, write_text
from scene.notebook import csv_text
from scene.store import Store

TWIN_TIME = "twin_processor_seconds"
"""Of a method, in `solve.methods`."""


def write_summary(job: Job, up_to: str) -> dict[str, Any]:
    """Write summary.json of what the finished steps said, after the verb `up_to`, and its tables; return it."""
    arguments = {
        "up_to": up_to,
        "session": str(job.session.folder),
        "methods": list(job.methods),
        "profile": job.profile,
        "external": {name: program.command for name, program in job.externals.items()},
        "twin": asdict(job.twin),
        "refine_lights": bool(job.settings.refine_lights),
        "trust": job.settings.trust,
        "truth": job.settings.truth,
        "tolerance_deg": job.tolerance_deg,
        "tolerances_deg": job.tolerances_deg,
    }
    done = job.done
    result = {step: done.get(step, {}).get("result", {}) for step in STEPS}
    twin, compared = dict(result["twin"]), dict(result["compare"])
    of_twin = twin.pop(TWIN_TIME, {})
    methods = {name: {**row, TWIN_TIME: of_twin.get(name)} for name, row in result["solve"].get("methods", {}).items()}
    truth_check = compared.pop("truth_check", None)
    summary = {
        "name": job.session.name,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": libraries(),
        "arguments": arguments,
        "seconds": {step: entry["seconds"] for step, entry in done.items()},
        "processor_seconds": {step: entry.get("processor_seconds") for step, entry in done.items()},
        "warnings": [{"step": step, "text": text} for step, entry in done.items() for text in entry["warnings"]],
        "capture": result["check"],
        "camera": job.store.read_json("camera.json") if job.store.path("camera.json").exists() else None,
        "calibrate": result["calibrate"],
        "align": result["align"].get("truth"),
        "solve": {"methods": methods},
        "trust": result["trust"] or None,
        "results": result["results"] or None,
        "twin": twin if twin.get("rendered") else None,
        "compare": compared,
    }
    if truth_check:
        summary["truth_check"] = truth_check
    write_json(job.store.path("summary.json"), summary)
    write_tables(job.store, compared)
    return job.store.read_json("summary.json")


def write_tables(store: Store, compared: dict[str, Any]) -> None:
    """Write lights.csv and statistics.csv; a table of what is not there, or no longer, is removed."""
    lights = store.load_lights().rows() if store.path("lights.json").exists() else []
    for name, rows in (("lights.csv", lights), ("statistics.csv", statistics_rows(compared))):
        if rows:
            write_text(store.path(name), csv_text(rows))
        else:
            remove(store.path(name))

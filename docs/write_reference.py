"""Write what the code itself says into docs/reference: keys of session.toml, verbs, what an opened session has.

    .venv/bin/python -m docs.write_reference

`tests/test_docs.py` fails where a page says something else.
"""

import inspect
import json
import re
from collections import Counter
from typing import Any

import rgbn
from benchmarks.harness import ROOT, markdown, put
from capture.session.manifest import TABLES, Manifest
from rgbn.cli import SESSION, app
from twin.description import description_file

REFERENCE = ROOT / "docs" / "reference"
TITLES = {"": "Above all tables", "spheres": "`[[spheres]]`", "camera.board": "`board` of `[camera]`"}
EITHER = ("number or text", 'number, 3 numbers, picture or `"vertex"`', "number or picture")
"""Kinds that no value shows."""
BOOL = "`true` or `false`"


def keys() -> str:
    """Return a section for each table of session.toml, a line for each key with an example, as Markdown."""
    lines = []
    whole = Manifest.model_json_schema()
    for name, table in TABLES.items():
        schema = whole if table is Manifest else whole["$defs"][table.__name__]
        lines += [f"## {TITLES.get(name, f'`[{name}]`')}", ""]
        if name:
            above, _, key = name.rpartition(".")
            lines += [TABLES[above].model_fields[key].description or "", ""]
        for key, field in schema["properties"].items():
            if f"{name}.{key}".strip(".") not in TABLES:
                takes = _brackets(_takes(key, field, key in schema.get("required", []), example=True))
                example = _toml((table.model_fields[key].examples or [])[0])
                lines.append(f"* `{key} = {example}`{takes}: {field['description']}")
        lines.append("")
    return "\n".join(lines)


def scene_keys() -> str:
    """Return a section for each table of a scene description, a line for each key with its default, as Markdown.

    Tables that differ by their kind share a section: a key that several kinds have alike is one line.
    """
    lines = []
    sections: dict[str, list[tuple[str, type]]] = {}
    for name, table in description_file.TABLES.items():
        section, _, kind = name.partition(" kind = ")
        sections.setdefault(section, []).append((kind.strip('"'), table))
    for section, tables in sections.items():
        lines += [f"### {f'`{section}`' if '[' in section else section or 'Above all tables'}", ""]
        rows: dict[tuple[str, str, str], list[str]] = {}
        for kind, table in tables:
            about = (table.__doc__ or "").split("\n\n")[0].replace("\n", " ").replace("    ", "")
            lines += [f'* `kind = "{kind}"`: {about}'] if kind else [about, ""] if section else []
            for key, field in description_file.keys_of(table).items():
                if key != "kind" and f"[{key}]" not in sections and f"[[{key}]]" not in sections:
                    value = _default(field)
                    row = (f"`{key} = {value}`" if value else f"`{key}`", _takes(key, field, field["required"]),
                           field.get("description", ""))  # fmt: skip
                    rows.setdefault(row, []).append(f"`{kind}`")
        lines += [""] * (len(tables) > 1)
        for (key, takes, what), kinds in rows.items():
            of = f"{', '.join(kinds)}: " * (0 < len(kinds) < len(tables) - 1)
            if len(kinds) == len(tables) - 1 > 1:
                of = "".join(f"all but `{kind}`: " for kind, _ in tables if f"`{kind}`" not in kinds)
            lines.append(f"* {key}{_brackets(of + takes)}: {what}")
        lines.append("")
    return "\n".join(lines)


def _brackets(takes: str) -> str:
    return f" ({takes.removesuffix(': ')})" if takes else ""


def _takes(key: str, field: dict[str, Any], is_required: bool, *, example: bool = False) -> str:
    """Say what a key takes, of its JSON schema, beyond what its name and its value show, in brackets.

    example: the value shown is an example; else it is the default, if there is one.
    """
    default, unit = _default(field), field.get("unit", "")
    is_shown, kind, said = example or bool(default), _kind(field), _range(field)
    if kind in EITHER or not (is_shown or said):
        said = kind
    elif is_shown and kind.startswith("`") and kind != BOOL:
        others = [one for one in kind.split(", ") if one != f"`{default}`"]
        said = "or " * (not example and bool(others)) + ", ".join(others)
    parts = [", ".join(filter(None, (said, unit * (not key.endswith(f"_{unit}"))))), "required" * is_required]
    if example and default and "Absent" not in field["description"]:
        parts.append(f"default `{default}`")
    return "; ".join(filter(None, parts))


def _range(field: dict[str, Any]) -> str:
    """Say which numbers a key takes, of its JSON schema; nothing where only what no scene has is refused."""
    for one in (field, *field.get("anyOf", []), *field.get("prefixItems", [])[:1]):
        low = max((one[name] for name in ("minimum", "exclusiveMinimum") if name in one), default=None)
        high = min((one[name] for name in ("maximum", "exclusiveMaximum") if name in one), default=None)
        if low is not None and high is not None and low != -high:
            is_above_none = 0 < low < 1e-5 or one.get("exclusiveMinimum") == 0
            least = "above 0" if is_above_none else f"{low:g}"
            return f"{least} to {high:,g}" if high < 1e6 else least if is_above_none else f"{low:g} or more"
    return ""


def _kind(field: dict[str, Any]) -> str:
    """Say a key's type in words, of its JSON schema."""
    if field.get("input") == "colour":
        return 'number, 3 numbers, picture or `"vertex"`'
    if field.get("input") == "share":
        return "number or picture"
    if "discriminator" in field.get("items", {}) or "additionalProperties" in field:
        return "tables"
    if not field.keys() & {"type", "anyOf", "$ref", "const", "enum"}:
        return "a file's name"
    if "prefixItems" in field:
        inner = _kind(field["prefixItems"][0])
        return f"{field['minItems']} {'x ' * inner[0].isdigit()}{inner}{'s' * (not inner.endswith('s'))}"
    if "$ref" in field or field.get("items", {}).get("$ref"):
        return "list of tables" if "items" in field else "table"
    if "anyOf" in field:
        return " or ".join(dict.fromkeys(_kind(one) for one in field["anyOf"] if one.get("type") != "null"))
    if "const" in field or "enum" in field:
        return ", ".join(f"`{_toml(value)}`" for value in field.get("enum", [field.get("const")]))
    if field.get("type") == "array":
        inner = _kind(field["items"])
        return "texts" if inner == "text" else f"{field['minItems']} {inner}s"
    return {"boolean": BOOL, "integer": "whole number", "number": "number", "string": "text"}[field["type"]]


def _default(field: dict[str, Any]) -> str:
    """Return a key's default as TOML has it; what holds without one is said in the key's description."""
    value = field.get("default")
    return "" if value is None or isinstance(value, dict) or value == [] else _toml(value)


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    return json.dumps(value)


def verbs() -> str:
    """Return the command line's own help, as Markdown: what several verbs take, once, then a section for each verb."""
    text = app.generate_docs(output_format="markdown", heading_level=1, usage_name="rgbn").replace("\n### ", "\n## ")
    order = re.findall(r"^\* \[`(.+?)`\]", text, re.MULTILINE)
    # `default: ()` and the like say nothing to who types.
    text = re.sub(r" \*\[default: (\(\)|False)\]\*", "", text)
    text = re.sub(r"(?m) CHOICE`(.*) \*\[choices: (.*?)\]\*", lambda m: f" {m[2].replace(', ', '|')}`{m[1]}", text)
    text = re.sub(r"```console\n.*?\n```\n\n", "", text)
    text = re.sub(r"(?m)^\* `([A-Z]+)`(?!.*\*\*\[required\]\*\*$)", r"* `[\1]`", text)
    text = re.sub(r"(?m)^(\* `[A-Z].*) \*\*\[required\]\*\*$", r"\1", text).replace("**[required]**", "Required.")
    # What the library says of its own verb is the shell's matter.
    text = re.sub(
        r"(?s)(\n## rgbn --install-completion\n.*?)\*\*Parameters\*\*.*?(?=\*\*Every verb|\n## |$)", r"\1", text
    )
    parts = sorted(text.split("\n## ")[2:], key=lambda part: order.index(part.split()[1]))
    options = [re.findall(r"^\* (.*)$", part, re.MULTILINE) for part in parts]
    every = re.findall(r"^\* (.*)$", text.partition("**Every verb**")[2].partition("\n## ")[0], re.MULTILINE)
    count = Counter(line for lines in options for line in lines if line.startswith("`-") or SESSION in line)
    several = [line for line in count if count[line] > 1 and line not in every]
    shared = [*every, *sorted(several, key=lambda line: line.startswith("`-"))]
    lines = [
        "## Options of several verbs",
        "",
        "Every verb takes the first two; below, *also* names others of these. `[NAME]` may be left out.",
        "",
    ]
    lines += [f"* {line}" for line in shared]
    for part, taken in zip(parts, options, strict=True):
        own = [line.replace(f" {SESSION} ", " As above. ") for line in taken if line not in shared]
        names = _runs([shared.index(line) for line in taken if line in shared and line not in every])
        lines += ["", f"## {re.split('^[*]', part, flags=re.MULTILINE)[0].strip()}", ""]
        lines += [f"* {line}" for line in own]
        if names:
            ends = [[f"`{re.split('[ ,:`]', shared[place])[1]}`" for place in run] for run in names]
            said = ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(run) for run in ends)
            lines += [""] * bool(own) + [f"Also {said}."]
    return "\n".join(lines).replace("\n\n\n", "\n\n").strip() + "\n"


def _runs(places: list[int]) -> list[list[int]]:
    """Return places in order, those that follow each other together."""
    runs: list[list[int]] = []
    for place in sorted(places):
        if runs and runs[-1][-1] == place - 1:
            runs[-1].append(place)
        else:
            runs.append([place])
    return runs


def members() -> str:
    """Return a row for each method and property of an opened session, as Markdown."""
    rows = [
        {
            "name": name if isinstance(member, property) else f"{name}{_call(member)}",
            "about": (inspect.getdoc(member) or "").split("\n\n")[0].replace("\n", " "),
        }
        for name, member in vars(rgbn.Session).items()
        if not name.startswith("_")
    ]
    return markdown({"of a session": "`{name}`", "what it is": "{about}"}, rows)


def _call(function: Any) -> str:
    """Return what stands in the brackets of a call, without types."""
    parameters = list(inspect.signature(function).parameters.values())[1:]
    return f"({', '.join(str(one.replace(annotation=inspect.Parameter.empty)) for one in parameters)})"


BLOCKS = {"session-toml.md": ("keys", keys), "scene-toml.md": ("keys", scene_keys), "verbs.md": ("verbs", verbs),
          "python.md": ("members", members)}  # fmt: skip
"""By page: the name of its block, and what writes it."""


if __name__ == "__main__":
    for page, (name, write) in BLOCKS.items():
        put(REFERENCE / page, name, write())

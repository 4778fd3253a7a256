"""Write what the code itself says into docs/reference: keys of session.toml, verbs, what an opened session has.

    .venv/bin/python -m docs.write_reference

`tests/test_docs.py` fails where a page says something else.
"""

import inspect
import json
import re
from typing import Any

import rgbn
from benchmarks.harness import ROOT, markdown, put
from capture.session.manifest import TABLES, Manifest
from rgbn.cli import app
from twin.description import description_file

REFERENCE = ROOT / "docs" / "reference"
TITLES = {"": "Above all tables", "spheres": "`[[spheres]]`", "camera.board": "`board` of `[camera]`"}


def keys() -> str:
    """Return a section for each table of session.toml, a row for each key, as Markdown."""
    lines = []
    definitions = Manifest.model_json_schema()["$defs"]
    for name, table in TABLES.items():
        schema = Manifest.model_json_schema() if table is Manifest else definitions[table.__name__]
        required = schema.get("required", [])
        lines += [f"## {TITLES.get(name, f'`[{name}]`')}", ""]
        if name:
            about = (table.__doc__ or "").split(": ", 1)[-1]
            lines += [about[:1].upper() + about[1:], ""]
        rows = [
            {
                "key": key, "type": _kind(field), "unit": field.get("unit", ""),
                "default": "required" if key in required else _default(field), "what": field.get("description", ""),
                "example": " ".join(f"`{key} = {_toml(one)}`" for one in table.model_fields[key].examples or []),
            }
            for key, field in schema["properties"].items()
        ]  # fmt: skip
        columns = {"key": "`{key}`", "type": "{type}", "unit": "{unit}", "default": "{default}"}
        lines.append(markdown({**columns, "what it is": "{what}", "example": "{example}"}, rows))
    return "\n".join(lines)


def scene_keys() -> str:
    """Return a section for each table of a scene description, a row for each key, as Markdown."""
    lines = []
    for name, table in description_file.TABLES.items():
        about = (table.__doc__ or "").split("\n\n")[0].replace("\n", " ").replace("    ", "")
        lines += [f"### {f'`{name}`' if '[' in name else name or 'Above all tables'}", "", about, ""]
        rows = [
            {
                "key": key, "type": _kind(field), "unit": field.get("unit", ""), "range": _range(field),
                "default": "required" if field["required"] else _default(field), "what": field.get("description", ""),
            }
            for key, field in description_file.keys_of(table).items() if key != "kind"
        ]  # fmt: skip
        columns = {"key": "`{key}`", "type": "{type}", "range": "{range}", "unit": "{unit}", "default": "{default}"}
        lines.append(markdown({**columns, "what it is": "{what}"}, rows))
    return "\n".join(lines)


def _range(field: dict[str, Any]) -> str:
    """Say which numbers a key takes, of its JSON schema; nothing where only what no scene has is refused."""
    for one in (field, *field.get("anyOf", []), *field.get("prefixItems", [])[:1]):
        low, high = one.get("minimum", one.get("exclusiveMinimum")), one.get("maximum", one.get("exclusiveMaximum"))
        if low is not None and high is not None and low != -high:
            least = "above 0" if 0 < low < 1e-5 else f"{low:g}"
            return f"{least} to {high:,g}" if high < 1e6 else least if low else "0 or more"
    return ""


def _kind(field: dict[str, Any]) -> str:
    """Say a key's type in words, of its JSON schema."""
    if field.get("input") == "colour":
        return 'number, list of 3, picture or `"vertex"`'
    if field.get("input") == "share":
        return "number or picture"
    if "discriminator" in field.get("items", {}) or "additionalProperties" in field:
        return "tables"
    if not field.keys() & {"type", "anyOf", "$ref", "const", "enum"}:
        return "a file's name"
    if "prefixItems" in field:
        inner = _kind(field["prefixItems"][0])
        return f"list of {field['minItems']} {inner}" + "s" * (not inner.endswith("s"))
    if "$ref" in field or field.get("items", {}).get("$ref"):
        return "list of tables" if "items" in field else "table"
    if "anyOf" in field:
        return next(_kind(one) for one in field["anyOf"] if one.get("type") != "null")
    if "const" in field or "enum" in field:
        return " or ".join(f"`{_toml(value)}`" for value in field.get("enum", [field.get("const")]))
    if field.get("type") == "array":
        inner = _kind(field["items"])
        return "text, or a list of texts" if inner == "text" else f"list of {field['minItems']} {inner}s"
    return {"boolean": "`true` or `false`", "integer": "whole number", "number": "number", "string": "text"}[
        field["type"]
    ]


def _default(field: dict[str, Any]) -> str:
    """Return a key's default as TOML has it; what is absent is said in the key's description."""
    value = field.get("default")
    return "" if value is None or isinstance(value, dict) or value == [] else f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    return json.dumps(value)


def verbs() -> str:
    """Return the command line's own help, as Markdown: a list of the verbs, then a section for each."""
    text = app.generate_docs(output_format="markdown", heading_level=1, usage_name="rgbn")
    listed = text.split("**Commands**:\n")[1].replace("\n### ", "\n## ")
    # `default: ()` and the like say nothing to who types.
    listed = re.sub(r" \*\[default: (\(\)|False)\]\*", "", listed)
    # Between verb and options the library names the program that runs here; and its own command's link is wrong.
    usage = r"(?m)^(## (rgbn.*)\n\n```console\n)(?:\2)?.*?( (?:--|\[|[A-Z]).*)?$"
    listed = re.sub(usage, r"\1\2\3", listed).replace("(#rgbn-install", "(#rgbn---install")
    first, *verbs = listed.split("\n## ")
    # What every verb takes is said once, above.
    verbs = [re.sub(r"\*\*Every verb\*\*:\n\n(\* .*\n)+\n?", "", verb + "\n") for verb in verbs]
    return "\n## ".join([first, *verbs]).strip() + "\n"


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

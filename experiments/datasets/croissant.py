"""Croissant 1.0 metadata, which machine-learning tools read: a dataset's files with checksums, its photographs, lights.

JSON-LD in the vocabularies of schema.org and of MLCommons [Akhtar2024]; https://docs.mlcommons.org/croissant/docs/croissant-spec.html
has the format.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.datasets.checksums import sums_of
from formats.diligent_layout import MASK, read_tables
from scene.current import libraries

FILE = "croissant.json"
FIRST_PUBLISHED = "2026-11-23"
LICENSE = "https://spdx.org/licenses/MIT.html"
"""The project's own."""
CITE = "S. Berkiten and S. Rusinkiewicz, An RGBN Benchmark, Princeton University, 2016; rendered and scored by rgbn"
_FORMATS = {
    ".png": "image/png", ".exr": "image/x-exr", ".txt": "text/plain", ".json": "application/json", ".csv": "text/csv",
    ".md": "text/markdown", ".toml": "application/toml", ".mat": "application/x-matlab-data",
}  # fmt: skip
_MLCOMMONS = "http://mlcommons.org/croissant/"
_CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": _MLCOMMONS,
    "rai": f"{_MLCOMMONS}RAI/",
    "dct": "http://purl.org/dc/terms/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "citeAs": "cr:citeAs", "column": "cr:column", "conformsTo": "dct:conformsTo", "extract": "cr:extract",
    "field": "cr:field", "fileObject": "cr:fileObject", "fileProperty": "cr:fileProperty", "fileSet": "cr:fileSet",
    "format": "cr:format", "includes": "cr:includes", "isLiveDataset": "cr:isLiveDataset", "jsonPath": "cr:jsonPath",
    "key": "cr:key", "md5": "cr:md5", "parentField": "cr:parentField", "path": "cr:path",
    "recordSet": "cr:recordSet", "references": "cr:references", "regex": "cr:regex", "repeated": "cr:repeated",
    "replace": "cr:replace", "separator": "cr:separator", "source": "cr:source", "subField": "cr:subField",
    "transform": "cr:transform",
}  # fmt: skip


def of_dataset(folder: Path, name: str, text: str, *, base: str = "", url: str = FILE) -> dict[str, Any]:
    """Return the metadata of a folder in the DiLiGenT layout.

    base: where its files are, ending in /; empty: beside the metadata. url: its page.
    """
    tables = read_tables(folder)
    files = [file_object(file, value, base + file) for file, value in sums_of(folder).items() if file != FILE]
    photographs = {
        "@type": "cr:FileSet", "@id": "photographs", "encodingFormat": "image/png",
        "includes": ["*"],
        "containedIn": [{"@id": file} for file in tables.files],
        "description": "one light each; linear, 65535 = 1; matte: value = albedo x intensity x cosine",
    }  # fmt: skip
    content = {"fileSet": {"@id": "photographs"}, "extract": {"fileProperty": "content"}}
    filename = {"fileSet": {"@id": "photographs"}, "extract": {"fileProperty": "filename"}}
    images = _records("images", "The photographs.", [
        field("images/file", "sc:Text", "the file", source=filename),
        field("images/image", "sc:ImageObject", "the picture", source=content),
    ], key="images/file")  # fmt: skip
    mask = {"fileObject": {"@id": MASK}, "extract": {"fileProperty": "content"}}
    masks = _records("masks", "Where the object is.", [field("masks/mask", "sc:ImageObject", "white", source=mask)])
    record_sets = [images, masks]
    if tables.directions is not None and tables.intensities is not None:
        rows = [
            {"file": file, **dict(zip("xyz", direction, strict=True)), **dict(zip("rgb", intensity, strict=True))}
            for file, direction, intensity in zip(
                tables.files, tables.directions.tolist(), tables.intensities.tolist(), strict=True
            )
        ]
        said = "A light for each photograph: unit vector toward it (x right, y up, z toward the viewer), intensity."
        lights = inline("lights", said, rows)
        lights["field"][0]["references"] = {"field": {"@id": "images/file"}}
        record_sets.append(lights)
    return metadata(name, text, [*files, photographs], record_sets, url=url)


def metadata(
    name: str, text: str, distribution: list[dict[str, Any]], record_sets: list[dict[str, Any]], *, url: str
) -> dict[str, Any]:
    """Return the JSON-LD of a dataset of these files and sets of records; `url`: its page."""
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": f"{_MLCOMMONS}1.0",
        "name": name,
        "description": text,
        "license": LICENSE,
        "url": url,
        "version": libraries()["rgbn"],
        "datePublished": FIRST_PUBLISHED,
        "creator": {"@type": "sc:Organization", "name": "the rgbn developers"},
        "citeAs": CITE,
        "keywords": ["photometric stereo", "surface normals", "benchmark"],
        "distribution": distribution,
        "recordSet": record_sets,
    }


def file_object(name: str, sha256: str, url: str = "") -> dict[str, Any]:
    """Return a file of a distribution; `url`: where it is, by default beside the metadata."""
    kind = _FORMATS.get(Path(name).suffix.lower(), "application/octet-stream")
    return {"@type": "cr:FileObject", "@id": name, "name": name, "contentUrl": url or name, "encodingFormat": kind,
            "sha256": sha256}  # fmt: skip


def field(name: str, kind: str, text: str, **more: Any) -> dict[str, Any]:
    """Return a field of a set of records."""
    return {"@type": "cr:Field", "@id": name, "name": name, "description": text, "dataType": kind, **more}


def inline(name: str, text: str, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return a set of records that stand in the metadata: rows of texts and numbers, whose first column is the key."""
    kinds = {column: "sc:Float" if isinstance(value, float) else "sc:Text" for column, value in rows[0].items()}
    fields = [field(f"{name}/{column}", kind, column) for column, kind in kinds.items()]
    data = [{f"{name}/{column}": value for column, value in row.items()} for row in rows]
    return {**_records(name, text, fields, key=f"{name}/{next(iter(kinds))}"), "data": data}


def of_table(name: str, text: str, file: str, columns: dict[str, str]) -> dict[str, Any]:
    """Return a set of records that are the rows of a CSV file of the distribution; columns: their types, by name."""
    kinds = {"string": "sc:Text", "float64": "sc:Float", "int64": "sc:Integer"}
    fields = [
        field(f"{name}/{one}", kinds[kind], one, source={"fileObject": {"@id": file}, "extract": {"column": one}})
        for one, kind in columns.items()
    ]
    return _records(name, text, fields)


def _records(name: str, text: str, fields: list[dict[str, Any]], *, key: str = "") -> dict[str, Any]:
    keyed = {"key": {"@id": key}} if key else {}
    return {"@type": "cr:RecordSet", "@id": name, "name": name, "description": text, **keyed, "field": fields}

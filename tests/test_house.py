"""The rules of the house: who imports whom, how big a file is, what every citation points to."""

import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter
from functools import cache

import pytest

from tests.conftest import ROOT

STEPS = ("capture", "calibrate", "align", "solve", "twin", "compare")
ROOMS = ("draw", "scene", "formats", *STEPS, "lab", "shoot", "experiments", "studio", "rgbn")
"""From the ground floor up: what a room may import stands before it; the steps never import each other."""
HEAVY = {"open3d", "mitsuba", "drjit", "viser", "dask", "distributed", "trimesh", "skimage", "rawpy"}
SOURCES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))


@cache
def tree_of(path):
    return ast.parse(path.read_text())


@cache
def import_nodes(path, *, top_only=False):
    """Return what a file imports, inside functions too."""
    tree = tree_of(path)
    return [
        node for node in (tree.body if top_only else ast.walk(tree)) if isinstance(node, ast.Import | ast.ImportFrom)
    ]


def imports(path, *, top_only=False):
    """Yield the first name of every module that a file imports."""
    for node in import_nodes(path, top_only=top_only):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        else:
            assert node.level == 0, "imports name their room"
            yield (node.module or "").split(".")[0]


def faults(path):
    """Yield what a file does against the rules."""
    room, tree = path.relative_to(ROOT).parts[0], tree_of(path)
    below = set(ROOMS[: ROOMS.index(room) + 1])
    allowed = below - (set(STEPS) - {room} if room in STEPS else set())
    all_names, top_names = set(imports(path)), set(imports(path, top_only=True))
    if above := all_names & set(ROOMS) - allowed:
        yield f"imports {above}"
    if heavy := top_names & HEAVY:
        yield f"heavy libraries are imported where they are used, not at the top: {heavy}"
    if room == "scene" and (foreign := top_names - {*sys.stdlib_module_names, "numpy", "scene"}):
        yield f"imports {foreign} at the top"
    if room == "draw" and (foreign := all_names - {*sys.stdlib_module_names, "numpy", "draw"}):
        yield f"imports {foreign}"
    if len(path.read_text().splitlines()) > 300:
        yield "has more than 300 lines"
    if path.stem in {"utils", "util", "helpers", "common", "misc"}:
        yield "is named after nothing that it does"
    if not ast.get_docstring(tree):
        yield "a file says what it is for"
    for node in tree.body:
        is_public = isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_")
        if is_public and not ast.get_docstring(node):
            yield f"{node.name} is public and has no docstring"


@pytest.mark.parametrize("room", ROOMS)
def test_the_files_of_a_room_keep_the_rules(room):
    files = [path for path in SOURCES if path.is_relative_to(ROOT / room)]
    assert files
    assert {str(path.relative_to(ROOT)): told for path in files if (told := [*faults(path)])} == {}


def import_circles():
    """Return the sets of files that import each other, directly or through others, inside functions too."""
    modules = {".".join(path.relative_to(ROOT).with_suffix("").parts): path for path in SOURCES}
    modules = {name.removesuffix(".__init__"): path for name, path in modules.items()}
    reached = {}
    for name, path in modules.items():
        found = set()
        for node in import_nodes(path):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            else:
                # Of a package either a file or a name is imported.
                found |= {f"{node.module}.{alias.name}" for alias in node.names} | {node.module}
        reached[name] = found & set(modules) - {name}
    for _ in range(len(modules).bit_length()):
        reached = {name: found.union(*(reached[other] for other in found)) for name, found in reached.items()}
    circles = {frozenset(other for other in found if name in reached[other]) for name, found in reached.items()}
    return circles - {frozenset()}


def test_no_file_imports_itself_through_others():
    assert not import_circles()


def test_no_two_files_and_no_two_classes_have_one_name():
    files = Counter(path.name for path in SOURCES if path.name != "__init__.py")
    classes = Counter(node.name for path in SOURCES for node in tree_of(path).body if isinstance(node, ast.ClassDef))
    assert not {name for name, count in files.items() if count > 1}
    assert not {name for name, count in classes.items() if count > 1}


def test_every_citation_is_in_the_bibliography():
    keys = set(re.findall(r"^@\w+\{(\w+),", (ROOT / "BIBLIOGRAPHY.bib").read_text(), re.MULTILINE))
    cited = {}
    for path in SOURCES:
        for key in re.findall(r"\[([A-Z][A-Za-z]+(?:19|20)\d\d[a-z]?)\]", path.read_text()):
            cited.setdefault(key, path.name)
    assert cited, "formulas have sources"
    assert set(cited) <= keys, {key: cited[key] for key in set(cited) - keys}
    assert keys <= set(cited), f"never cited: {keys - set(cited)}"


def test_the_project_installs_every_room_and_every_import():
    """What the rooms import is named in pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == list(ROOMS)
    declared = {re.split(r"[\[<>= ]", line)[0].lower() for line in project["project"]["dependencies"]}
    distribution = {"cv2": "opencv-contrib-python-headless", "skimage": "scikit-image", "drjit": "mitsuba",
                    "libusb_package": "libusb-package", "distributed": "dask", "PIL": "pillow", "markupsafe": "jinja2",
                    "OpenEXR": "openexr", "fpdf": "fpdf2",
                    "docstring_parser": "docstring-parser"}  # fmt: skip
    used = {name for path in SOURCES for name in imports(path)}
    foreign = used - set(ROOMS) - set(sys.stdlib_module_names)
    assert {distribution.get(name, name) for name in foreign} <= declared


def test_the_lock_file_is_that_of_the_project():
    """Every requirement is locked, in its range, with hashes, from no other place than the usual one."""
    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text())
    project = pyproject["project"]
    text = (ROOT / "requirements.lock").read_text()
    assert not re.search(r"https?:|file:|^ *-(?!-hash)| @ ", text, re.MULTILINE)
    locked = {}
    for entry in re.split(r"\n(?=\w)", text.partition("\n#    make lock\n")[2]):
        assert "--hash=sha256:" in entry, entry.splitlines()[0]
        name, version = re.match(r"([\w.-]+)==([\w.+!]+)", entry).groups()
        locked.setdefault(name, []).append(version)
    extras = project["optional-dependencies"]["dev"]
    for line in (*project["dependencies"], *extras, *pyproject["build-system"]["requires"]):
        wanted = Requirement(line)
        versions = locked.get(canonicalize_name(wanted.name))
        assert versions, f"{line} is not locked: make lock"
        assert all(wanted.specifier.contains(version) for version in versions), f"{line}, {versions}: make lock"


def test_no_path_of_a_machine_is_in_the_project():
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in tracked.stdout.splitlines():
        path = ROOT / name
        if path.suffix in {".py", ".md", ".toml", ".sh", ".yml", ".html", ".css", ".json", ""} and path.is_file():
            text = path.read_text(errors="ignore")
            assert not re.search(r"(?<![\w.])/(work|home|root|Users)/", text), name

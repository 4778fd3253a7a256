"""The command line: what it prints, how loud it is, what it takes, and what it completes."""

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from compare.report.facts import all_warnings
from lab.options import Solving, TwinSettings, named
from rgbn.exit_codes import end_by
from rgbn.export_command import FORMATS, export
from scene.errors import SceneError
from scene.method_names import METHODS
from tests.lab.test_foreign_files import make_session
from tests.test_house import HEAVY


@pytest.fixture
def run(run_rgbn, monkeypatch, tmp_path):
    """Run the command line in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return run_rgbn


@pytest.fixture
def session(tmp_path):
    """A session of four known lights, without a scan, that is solved in a moment."""
    make_session(tmp_path / "pear")
    return tmp_path / "pear"


def table(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def last_lines(out):
    return {line.split()[0]: " ".join(line.split()[1:]) for line in out.splitlines() if line[:1].isalpha()}


def test_each_verb_shows_its_own_findings_and_leads_to_the_next(run, session):
    """An output folder is all that the next verb needs."""
    titles = {"check": "pear: check", "calibrate": "calibrate: 4 distant lights", "align": "align", "solve": "solve"}
    words = [session]
    for verb in titles:
        code, out, said = run(verb, *words)
        assert code == 0, said
        shown = {other for other, text in titles.items() if any(line.startswith(text) for line in out.splitlines())}
        assert shown == {verb}, out
        ends = last_lines(out)
        assert ends["written"] == "out/pear"
        words = ends["next"].split()[2:]
        assert words == ["out/pear"]
    assert ends["next"] == "rgbn compare out/pear", "there is no scan to render"
    code, out, said = run("compare", *words, "-m", "LS,Iterative")
    assert code == 0
    warned = all_warnings(json.loads(Path("out/pear/summary.json").read_text()))
    assert {"check", "calibrate"} <= {step for step, _ in warned}
    assert all(f"warning ({step}): {text}" in said for step, text in warned), "each is said"
    assert "report.html" in last_lines(out)["next"]
    code, out, _ = run("process", *words, "-m", "ls,iterative")
    assert all(any(line.startswith(text) for line in out.splitlines()) for text in titles.values())


def test_quiet_says_warnings_and_errors_alone(run, session):
    code, out, loud = run("solve", session, "-o", "loud")
    warnings = [line for line in loud.splitlines() if line.startswith("warning")]
    assert warnings, "the session has no scan, which is worth a warning"
    assert len(loud.splitlines()) > len(warnings)
    for words in (("solve", session, "-o", "still", "-q"), ("--quiet", "solve", session, "-o", "calm")):
        assert run(*words) == (0, "", "".join(f"{line}\n" for line in warnings))
    code, out, said = run("solve", session, "-m", "magic", "-q")
    assert (code, out) == (2, "")
    assert said.startswith("rgbn: --method magic: magic is unknown")
    # What was asked for is printed all the same; and the next run is as loud as ever.
    code, out, said = run("solve", session, "-o", "still", "--json", "-q")
    assert json.loads(out)["name"] == "pear"
    _, out, said = run("solve", session, "-o", "still")
    assert "written" in out
    assert said.splitlines() == warnings


def test_lights_are_a_table_for_a_spreadsheet_and_exported_in_every_format(run, session):
    code, out, said = run("export", session, "-f", "DILigent,dome,lp")
    assert code == 0, said
    folder = Path("out/pear/export")
    names = {path.name for path in folder.iterdir()}
    assert {"lights.dome", "light_directions.txt", "lights.lp"} <= names
    assert {Path(line) for line in out.splitlines()} == {path.resolve() for path in folder.iterdir()}
    assert run("calibrate", "out/pear")[0] == 0
    rows = table(Path("out/pear/lights.csv"))
    lp = [line.split() for line in (folder / "lights.lp").read_text().splitlines()[1:]]
    assert [f"{row['name']}.png" for row in rows] == [name for name, *_ in lp]
    for row, (_, *direction) in zip(rows, lp, strict=True):
        assert [float(row[f"direction_{axis}"]) for axis in "xyz"] == pytest.approx([*map(float, direction)], abs=1e-7)
        assert row["x_mm"] == "", "a distant light has no position"
    assert not Path("out/pear/statistics.csv").exists(), "nothing was compared"
    # What was exported does not outlive the lights that it was made from.
    known = session / "known" / "lights.lp"
    known.write_text(known.read_text().replace("1.0", "0.9"))
    assert run("export", session, "-f", "lp")[0] == 0
    assert [path.name for path in folder.iterdir()] == ["lights.lp"]


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["solv", "x"], ['Unknown command "solv"', '"solve"', "`rgbn --help`"]),
        (["solve", "x", "--metod", "ls"], ["--metod", "--method", "`rgbn solve --help`"]),
        (["solve"], ["SESSION", "`rgbn solve --help`"]),
        (["twin", "x", "--engine", "fast"], ["fast", "--engine", '"many", "mitsuba"']),
        (["twin", "x", "--engine", "many,mitsuba"], ["many,mitsuba", "--engine", '"many", "mitsuba"']),
        (["solve", "x", "--normals", "foo"], ["foo", "--normals", '"opengl", "directx"']),
        (["export", "x", "-f", "xml"], ["--format xml", "diligent", "heritage, mitsuba"]),
        (["solve", "x", "--profile", "sead", "-m", "ls"], ["sead", "default, seed"]),
        *(
            (
                ["solve", "x", "--external", "A=a {data} {out}", "--external-timeout-s", text],
                ["expected seconds above 0"],
            )
            for text in ("0", "-5", "nan")
        ),
    ],
)
def test_a_slip_is_one_message_with_what_there_is(run, words, parts):
    code, out, said = run(*words)
    assert (code, out) == (2, "")
    assert said.startswith("rgbn: ")
    assert said.count("\n") == 1
    for part in parts:
        assert part in said


def test_doctor_says_what_to_do(run, monkeypatch):
    from rgbn import doctor

    good = {"packages": lambda: ("ok", "all there")}
    monkeypatch.setattr(doctor, "CHECKS", {**good, "disk": lambda: ("!", "2 GB free here")})
    code, out, said = run("doctor")
    assert (code, said) == (0, "")
    assert out.splitlines()[0].split() == ["ok", "packages", "all", "there"]
    assert out.splitlines()[-1].startswith("rgbn can be used here.")
    assert run("doctor", "-q")[1].split()[:2] == ["!", "disk"]
    monkeypatch.setattr(doctor, "CHECKS", {**good, "renderer": lambda: ("X", "gone. Run: make setup")})
    code, out, said = run("doctor")
    assert code == 2
    assert "renderer" in said
    assert "make setup" in out


@pytest.mark.parametrize(("verb", "option", "known"), [(Solving, "method", METHODS), (export, "format", FORMATS)])
def test_the_help_lists_what_there_is(verb, option, known):
    """It may not load them to find out."""
    text = get_args(get_type_hints(verb, include_extras=True)[option])[1].help
    assert text.split(": ")[1].split(". ")[0].split(", ") == list(known)


def test_names_are_read_in_any_case_and_each_once():
    assert Solving("LS,Iterative, ls").methods() == ("ls", "iterative")
    assert named("--on", "net,TWO", ("Net", "two")) == ("Net", "two")
    for text, unknown in (("ls,magic", "magic is unknown"), (" , ", "nothing is unknown")):
        with pytest.raises(SceneError, match=f"{unknown}; there are ls, iterative,"):
            Solving(text).methods()
    with pytest.raises(SceneError, match="--engine fast: fast is unknown; there are auto, many"):
        TwinSettings(engine="fast")


def test_help_loads_nothing_of_what_the_verbs_do():
    """It took 1.5 processor seconds of `studio`, 1.3 of `watch`, 0.8 of `export`, where 0.2 are enough.

    The command line itself loads nothing heavy, nor numpy and its friends.
    """
    verbs = ["init", "plan", "watch", "process", "studio", "sweep", "series", "dataset run", "dataset make", "export"]
    program = (
        "import sys; from rgbn.cli import main\n"
        "def tell(): print('loaded', *{name.split('.')[0] for name in sys.modules})\n"
        "tell()\n"
        f"for verb in {['', *verbs]}:\n"
        "    sys.argv = ['rgbn', *verb.split(), '--help']\n"
        "    try:\n        main()\n    except SystemExit:\n        pass\n"
        "    tell()"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert ended.stdout.count("Usage: rgbn") == 1 + len(verbs)
    first, *loaded = [set(line.split()) for line in ended.stdout.splitlines() if line.startswith("loaded ")]
    assert not first & (HEAVY | {"numpy", "scipy", "cv2", "numba", "pydantic", "tifffile", "h5py"})
    found = {"viser", "pydantic", "cv2", "scipy"}
    assert {verb: names & found for verb, names in zip(["", *verbs], loaded, strict=True) if names & found} == {}


def test_an_error_whose_causes_go_round_in_a_circle_ends_all_the_same(capfd):
    error, other = SceneError("the fault"), ValueError()
    error.__cause__, other.__context__ = other, error
    with pytest.raises(SystemExit) as ended:
        end_by(error)
    assert ended.value.code == 2
    assert "rgbn: the fault" in "".join(capfd.readouterr())

"""Whatever lies where, no verb writes over, changes or removes a file that rgbn did not write."""

import shutil
from itertools import pairwise

import numpy as np
import pytest

from scene.files import write_png

NAMES = (
    "twin/photograph.dng", "align/notes.txt", "compare/error_real_ls.npy", "export/lights.lp", "normals/ls.npy",
    "lights.lp", "lights.json", "mask.png", "report.html", "summary.json", "frames/codes.npy", ".lock", ".note.tmp",
    "raw/flash_0.dng", "session.toml", "steps.json", "external/Net/out/normals.npy",
)  # fmt: skip
"""Of the user's files: some have the names of results."""
LIGHTS = [(0.3, 0.1, 1.0), (-0.3, 0.2, 1.0), (0.1, -0.4, 1.0), (0.0, 0.3, 1.0)]


def make_session(folder):
    """A session that is solved in a moment: four photographs with known lights and a mask."""
    (folder / "known").mkdir(parents=True)
    shades = np.random.default_rng(10_000).uniform(2000, 30000, (4, 24, 32, 3))
    for index, shade in enumerate(shades):
        write_png(folder / f"flash_{index}.png", shade.astype(np.uint16))
    mask = np.zeros((24, 32), bool)
    mask[6:18, 8:24] = True
    write_png(folder / "mask.png", mask)
    rows = "".join(f"flash_{index}.png {x} {y} {z}\n" for index, (x, y, z) in enumerate(LIGHTS))
    (folder / "known" / "lights.lp").write_text(f"4\n{rows}")
    (folder / "session.toml").write_text(
        '[frames]\nflash = "flash_*.png"\nlinear = true\n[lights]\nfile = "known/lights.lp"\n[object]\n'
        'mask = "mask.png"\n'
    )


def files_of(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file() and ".rgbn" not in path.parts}


def some_folder(root, generator):
    """Return a folder that may be anything: an input's, above or below one, the user's, linked, or new."""
    places = ["session", "session/known", "session/out", ".", "photos", "photos/new", "new", "new/within", "link"]
    return root / generator.choice(places)


@pytest.mark.parametrize("seed", [10_000, pytest.param(10_001, marks=pytest.mark.full)])
def test_no_file_of_the_users_is_lost(tmp_path, monkeypatch, run_rgbn, seed):
    """Ten layouts, and 70 more in `make test-all`; several runs in each, with results of earlier ones."""
    generator = np.random.default_rng(seed)
    ended = set()
    for layout in range(10 if seed == 10_000 else 70):
        root = tmp_path / str(layout)
        make_session(root / "session")
        for name in generator.choice(NAMES, generator.integers(1, 6), replace=False):
            path = some_folder(root, generator) / name
            if not path.exists() and not any(place.is_file() for place in path.parents):
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(generator.bytes(20))
        (root / "link").symlink_to("photos") if not (root / "link").exists() else None
        mine, made = files_of(root), set()
        for turn in range(3):
            out = some_folder(root, generator)
            verb = ["check", "solve", "export"][generator.integers(3)]
            more = {"solve": ["--method", "ls"], "export": ["--format", "dome"]}.get(verb, [])
            monkeypatch.chdir(root)
            code, _, said = run_rgbn(verb, root / "session", "--out", out, *more)
            assert code in (0, 2), said
            ended.add(code)
            now = files_of(root)
            for path, content in mine.items():
                assert now.get(path) == content, f"{path}: layout {layout}, turn {turn}, {verb} --out {out}"
            made |= set(now) - set(mine)
            if made and generator.random() < 0.5:
                # The user changes a result: from now on it is his.
                path = sorted(made)[generator.integers(len(made))]
                if path.exists():
                    path.write_bytes(b"changed by hand")
                    mine[path] = b"changed by hand"
        shutil.rmtree(root)
    assert ended == {0, 2}


@pytest.mark.parametrize("words", [["--out", ""], ["--out="]])
def test_an_empty_word_is_not_the_current_folder(tmp_path, monkeypatch, run_rgbn, words):
    """`--out "$OUT"` where the variable is not set."""
    make_session(tmp_path / "session")
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    code, _, said = run_rgbn("check", tmp_path / "session", *words)
    assert code == 2
    assert "--out: nothing is given after it" in said
    assert not list((tmp_path / "here").iterdir())


def test_what_a_library_or_the_user_has_changed_is_made_anew(tmp_path, monkeypatch, run_rgbn):
    """Photographs exchanged with size and time kept; another version of a library; frames that were zeroed."""
    from scene import current

    make_session(tmp_path / "session")
    out = tmp_path / "out"
    words = ("solve", tmp_path / "session", "--out", out, "--method", "ls")

    def run():
        code, _, said = run_rgbn(*words)
        return code, "check ..." in said, (out / "normals" / "ls.npy").read_bytes()

    code, was_decoded, first = run()
    assert (code, was_decoded) == (0, True)
    assert run() == (0, False, first)

    photographs = [tmp_path / "session" / f"flash_{index}.png" for index in (0, 1, 9)]
    for old, new in pairwise((photographs[2], photographs[0], photographs[1], photographs[2])):
        new.rename(old)
    code, was_decoded, second = run()
    assert (code, was_decoded) == (0, True)
    assert second != first

    monkeypatch.setattr(current, "libraries", lambda: {"numpy": "of another year", "rgbn": "0"})
    code, was_decoded, third = run()
    assert (code, was_decoded, third) == (0, True, second)

    codes = out / "frames" / "codes.npy"
    codes.write_bytes(bytes(codes.stat().st_size))
    code, _, said = run_rgbn(*words)
    assert code == 2
    assert "codes.npy: was changed after rgbn wrote it" in said
    codes.unlink()
    assert run() == (0, True, third)

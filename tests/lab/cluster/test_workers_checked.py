"""No worker works that would give something else: one of other code, of other libraries, or without the folder."""

import shutil
from pathlib import Path

import pytest

from lab.cluster import pack, serve
from scene.current import ROOMS, ROOT, code_fingerprint, libraries
from scene.errors import ClusterError


@pytest.fixture
def other_house(tmp_path):
    """The house with one line changed: every sample a code higher."""
    house = tmp_path / "house"
    for room in ROOMS:
        shutil.copytree(ROOT / room, house / room, ignore=shutil.ignore_patterns("__pycache__"))
    file = house / "capture" / "photographs" / "develop.py"
    text = file.read_text()
    assert text.count("ascontiguousarray(codes)") == 1
    file.write_text(text.replace("ascontiguousarray(codes)", "ascontiguousarray(codes + 1)"))
    return house


@pytest.mark.full
def test_a_worker_of_other_code_that_joins_later_is_refused(session, cluster, other_house, refused, same, tmp_path):
    cluster.start_scheduler()
    cluster.start_worker(habit=cluster.SLOW)
    run = cluster.begin(session[0], tmp_path / "out")
    stranger = cluster.start_worker(house=other_house)
    refused(cluster.finish(run), f"the code of its rgbn in {other_house} is another", "What is done is kept")
    stranger.kill()
    stranger.wait()
    cluster.start_worker()
    done = cluster.solve(session[0], tmp_path / "out")
    assert done.returncode == 0, done.stderr
    same(tmp_path / "out")


@pytest.mark.full
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "tcp://", "foo://a:1"])
def test_a_scheduler_that_does_not_answer(session, cluster, refused, tmp_path, address):
    cluster.address = address
    refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "no Dask scheduler answers", "dask scheduler")


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ({"code": "0" * 40}, "the code of its rgbn in .* is another"),
        ({"libraries": {"scipy": "1.0"}}, r"its scipy is .*, expected 1\.0"),
        ({"folder": Path("nowhere")}, "does not see the output folder nowhere"),
    ],
)
def test_a_worker_that_would_give_something_else_is_refused(tmp_path, other, told):
    """Of other code or libraries, or on other folders."""
    run = {"scheduler": "tcp://here", "folder": tmp_path, "code": code_fingerprint(), "libraries": libraries()}
    unit = pack((len, ["ab"], {}), None)
    assert serve(run, unit) == 2
    with pytest.raises(ClusterError, match=f"would not do as this computer does: .*{told}.*start it again"):
        serve(run | other, unit)


@pytest.mark.full
def test_a_worker_whose_code_was_changed_after_it_had_loaded_it_is_refused(
    session, cluster, other_house, refused, tmp_path
):
    """Its files are the expected ones again, but what it has loaded is not."""
    cluster.start_scheduler()
    cluster.start_worker(house=other_house)
    refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "is another")
    shutil.copy(ROOT / "capture" / "photographs" / "develop.py", other_house / "capture" / "photographs" / "develop.py")
    refused(cluster.run("check", session[0], "--out", tmp_path / "out"), "is another", "start it again")

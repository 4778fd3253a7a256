"""What a test of `make test` may cost: 5 processor seconds, unless marked `full`; the command line; a browser."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

# Before numpy: it holds OpenBLAS to one thread, as in the command line; two workers' would wait for each other.
import scene  # noqa: F401

ROOT = Path(__file__).parents[1]
FIXTURE = ROOT / "fixtures" / "bumpy"
"""The session that comes with rgbn, whose truth is known."""
LIMIT_S = 5.0
"""Of one test's own work, fixtures that it shares and compiling apart, where a million additions take `MILLION_S`."""
MILLION_S = 0.04
ARGUMENTS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
]


def processor_s():
    """Return the seconds that this process and the programs that it waited for have computed."""
    return sum(os.times()[:4])


def million_s():
    """Return the processor seconds that a million additions take now: a shared machine is twice as slow at times."""
    spent = []
    for _ in range(5):
        before, total = time.process_time(), 0
        for number in range(1_000_000):
            total += number
        spent.append(time.process_time() - before)
    return max(spent)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Fail a test of `make test` that costs what belongs into `make test-all`."""
    from numba.core.event import install_timer

    before, compiled = processor_s(), []
    with install_timer("numba:compile", compiled.append):
        result = yield
    spent = processor_s() - before - sum(compiled)
    item.user_properties.append(("processor_s", round(spent, 2)))
    if spent > LIMIT_S and not item.get_closest_marker("full") and spent > LIMIT_S * million_s() / MILLION_S:
        pytest.fail(f"{spent:.1f} processor seconds, more than {LIMIT_S:g}: make it smaller, or mark it full")
    return result


@pytest.fixture
def run_rgbn(monkeypatch, capsys):
    """Run the command line in this process; give exit code, standard output and error."""
    from rgbn import cli

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["rgbn", *map(str, words)])
        capsys.readouterr()
        code = 0
        try:
            cli.main()
        except SystemExit as ended:
            code = ended.code
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def no_report(monkeypatch):
    """`compare` writes no report, which takes longer than all else on a small session."""
    monkeypatch.setattr("compare.report.report.write_report", lambda *_: None)


@pytest.fixture
def set_threads():
    """Set how many threads render; in the end there are as many as before."""
    import drjit

    before = drjit.thread_count()
    yield drjit.set_thread_count
    drjit.set_thread_count(before)


@pytest.fixture(scope="session")
def rgbn_process():
    """Run this checkout's command line in a process of its own; give what `subprocess.run` does."""

    def run(*words):
        command = [sys.executable, "-c", "from rgbn.cli import main; main()", *map(str, words)]
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)

    return run


@pytest.fixture(scope="session")
def shared():
    """Return a path under the captures that others made, which are no part of the repository; skip where it is not."""

    def at(name):
        path = ROOT / ".." / "shared" / name
        if not path.exists():
            pytest.skip(f"../shared/{name} is absent")
        return path

    return at


def until(condition, said=lambda: "it took too long"):
    """Wait until something is so; where it takes too long, tell what was said."""
    end = time.monotonic() + 240
    while not condition():
        assert time.monotonic() < end, said()
        time.sleep(0.02)


def started(*words, **how):
    """Start this checkout's command line, which Ctrl-C ends also where the shell that runs the tests ignores it."""
    code = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from rgbn.cli import main; main()"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", code, *map(str, words)], env=environment, **pipes, **how)


@pytest.fixture(scope="session")
def chromium():
    """The system's Chromium, driven by Playwright."""
    path = os.environ.get("RGBN_CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        pytest.skip("no Chromium is installed: apt-get install chromium, or name one in RGBN_CHROMIUM")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        yield browser
        browser.close()


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    """Take the files of long tests first, of those that are run: in the end both workers have short ones left."""
    long = {item.path for item in items if item.get_closest_marker("full") or item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in long)

"""Fixtures that all tests share, and their order."""

from collections.abc import Iterator
from functools import cache
import gc
import json
import os
from pathlib import Path
import shutil
import subprocess
from typing import Any

from hypothesis import settings
import pytest
from xdist.scheduler import LoadScopeScheduling

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

GOLDEN = Path(__file__).parent / "golden.json"

FIRST = ("resection", "gauze", "wrist", "snake")
"""Systems whose tests take longest and compile most kernels: they are begun with."""

NOTEBOOKS = {
    **dict.fromkeys(("bedside", "gauze_delivery", "inside", "tool_bypass"), "gauze"),
    **dict.fromkeys(("perception", "switching_potentials"), "navigation"),
    **dict.fromkeys(("snake_statics", "wire_snake"), "snake"),
    **{"passive_wrist": "wrist", "resection": "resection", "keyhole": "keyhole"},
    **{"learning": "learning"},
}
"""What is shown in which notebook."""

CHROMIUM_FLAGS = [
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--virtual-time-budget=8000",
    "--window-size=1200,800",
]


@cache
def systems() -> dict[str, str]:
    """The system of every row of golden figures."""
    return {row: told["system"] for row, told in json.loads(GOLDEN.read_text()).items()}


def group(nodeid: str) -> str:
    """What runs on one worker: all tests of a system's diagram, else those of a file.

    They share runs of scenarios, and no two workers compile the same kernels.
    """
    path, _, name = nodeid.partition("::")
    row = name.partition("[")[2].removesuffix("]")
    if "test_golden" in path and row in systems():
        return systems()[row]
    if name.startswith("test_it_runs") and row in NOTEBOOKS:
        return NOTEBOOKS[row]
    folder = Path(path).parent
    return folder.name if folder.parent.name == "diagrams" else path


class BySystem(LoadScopeScheduling):
    """Gives each worker whole groups of tests."""

    def _split_scope(self, nodeid: str) -> str:
        return group(nodeid)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> BySystem:
    """Takes the place of `--dist`."""
    return BySystem(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts the long groups first."""
    place = {name: number for number, name in enumerate(FIRST)}
    items.sort(key=lambda item: place.get(group(item.nodeid), len(FIRST)))


def pytest_collection_finish() -> None:
    """Lets the collector run more rarely: it took a tenth of the time to compile.

    numba makes and drops millions of small objects, beside all that was imported.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 100)


@pytest.fixture(scope="session")
def chromium() -> str:
    """Where Chromium is."""
    found = shutil.which("chromium") or shutil.which("google-chrome")
    if found is None:
        reason = "no Chromium on this machine: no page can be opened"
        if os.environ.get("TROCAR_REQUIRE_BROWSER"):
            pytest.fail(reason)
        pytest.skip(reason)
    return found


@pytest.fixture(scope="module")
def browser(chromium: str) -> Iterator[Any]:
    """Headless Chromium, driven by Playwright: `browser.new_page()`.

    Not for the session: while Playwright runs, its event loop counts as this thread's,
    and what calls `asyncio.run` in another module would be refused.
    """
    from playwright.sync_api import sync_playwright

    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(
            executable_path=chromium, args=[*flags, "--use-gl=angle"]
        )
        yield found
        found.close()


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """An empty page of 1200 x 800; it must not have failed by itself."""
    failures: list[str] = []
    opened = browser.new_page(viewport={"width": 1200, "height": 800})
    opened.set_default_timeout(180_000)  # ms, as patient as `screenshot`
    opened.on("pageerror", lambda error: failures.append(str(error)))
    yield opened
    opened.close()
    assert not failures


@pytest.fixture(scope="session")
def screenshot(chromium: str, tmp_path_factory: pytest.TempPathFactory):
    """A function that opens an HTML file in headless Chromium and returns a PNG."""

    def take(page: Path) -> Path:
        picture = tmp_path_factory.mktemp("screenshot") / f"{page.stem}.png"
        profile = tmp_path_factory.mktemp("profile")
        subprocess.run(
            [
                chromium,
                *CHROMIUM_FLAGS,
                f"--user-data-dir={profile}",
                f"--screenshot={picture}",
                page.resolve().as_uri(),
            ],
            check=True,
            capture_output=True,
            timeout=180,
        )
        return picture

    return take

"""Fixtures that all tests share, and their order."""

import os
from pathlib import Path
import shutil
import subprocess

from hypothesis import settings
import pytest

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

DIAGRAMS = Path(__file__).parent / "diagrams"

FIRST = ("resection", "gauze", "wrist", "snake")
"""Systems whose tests take longest and compile most kernels: they are begun with."""

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


def group(item: pytest.Item) -> str:
    """What runs on one worker: all tests of a system's diagram, else those of a file.

    They share runs of scenarios, and no two workers compile the same kernels.
    """
    marker = item.get_closest_marker("xdist_group")
    if marker is not None:
        return str(marker.args[0])
    folder = item.path.parent
    return folder.name if folder.parent == DIAGRAMS else str(item.path)


@pytest.hookimpl(tryfirst=True)  # before the workers read the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Groups the tests, and puts the long groups first."""
    groups = {item: group(item) for item in items}
    for item, name in groups.items():
        item.add_marker(pytest.mark.xdist_group(name))
    place = {name: number for number, name in enumerate(FIRST)}
    items.sort(key=lambda item: place.get(groups[item], len(FIRST)))


@pytest.fixture(scope="session")
def screenshot(tmp_path_factory: pytest.TempPathFactory):
    """A function that opens an HTML file in headless Chromium and returns a PNG."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        reason = "no Chromium on this machine: the replay cannot be opened"
        if os.environ.get("TROCAR_REQUIRE_BROWSER"):
            pytest.fail(reason)
        pytest.skip(reason)

    def take(page: Path) -> Path:
        picture = tmp_path_factory.mktemp("screenshot") / f"{page.stem}.png"
        profile = tmp_path_factory.mktemp("profile")
        subprocess.run(
            [
                browser,
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

"""Fixtures that all tests share."""

import os
from pathlib import Path
import shutil
import subprocess

from hypothesis import settings
import pytest

settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")

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

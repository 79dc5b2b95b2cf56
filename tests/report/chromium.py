"""Pages opened in real Chromium, as a reader opens them; what went wrong there fails the test."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ABSENT = "Chromium absent: "
NAMES = ("chromium", "chromium-browser", "google-chrome")
PHONE, DESK = (390, 844), (1100, 900)


class Chromium:
    """A browser without a window, with the few things a reader does in it."""

    def __init__(self):
        from selenium import webdriver

        options = webdriver.ChromeOptions()
        options.binary_location = _program(NAMES)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        # --no-sandbox: in a container there is no sandbox to be had, and the pages are our own.
        for option in ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"):
            options.add_argument(option)
        service = webdriver.ChromeService(_program(("chromedriver",)))
        self.driver = webdriver.Chrome(options=options, service=service)
        self.driver.set_script_timeout(60)

    @contextmanager
    def opened(self, path: Path, size=DESK, dark=False) -> Iterator[Chromium]:
        """A page just opened; fails at the end where it complained.

        Its policy allows no other file: a request for one is a complaint.
        """
        self.show(size, dark)
        self.driver.get_log("browser")
        self.driver.get(path.as_uri())
        self.run("await new Promise((go) => setTimeout(go, 500))")
        yield self
        worse = [each for each in self.driver.get_log("browser") if each["level"] != "INFO"]
        assert worse == [], worse

    def show(self, size: tuple[int, int] = DESK, dark: bool = False, media: str = "") -> None:
        """The size of the window, the colours the reader prefers, and screen or paper."""
        width, height = size
        told = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": size == PHONE}
        self.command("Emulation.setDeviceMetricsOverride", **told)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.command("Emulation.setEmulatedMedia", media=media, features=[scheme])

    def run(self, script: str, *values: object):
        """What a script returns; a promise is waited for."""
        return self.driver.execute_script(f"return (async () => {{{script}}})()", *values)

    def command(self, name: str, **values: object) -> dict:
        return self.driver.execute_cdp_cmd(name, values)


def _program(names: tuple[str, ...]) -> str:
    """Path of the first of the programs that is there; skips the test where none is, but in CI."""
    found = next(filter(None, map(shutil.which, names)), None)
    if found is None:
        told = f"{ABSENT}no {' or '.join(names)} on the search path"
        pytest.fail(told) if os.environ.get("CI") else pytest.skip(told)
    return found

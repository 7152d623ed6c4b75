"""A real browser without network, and the reports that it opens."""

import json
import shutil
from base64 import b64decode
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from savgs_ident.core.presentation import Origin
from savgs_ident.inference.result import HarmonicPosterior
from savgs_ident.report.posterior.page import posterior_html

from ..report.posterior_synthetic import nominal_response, renamed, synthetic_posterior, unconverged

if TYPE_CHECKING:
    from selenium import webdriver

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
HOSTILE = "<script>alert(1)</script>\"'&amp;</td><img src=x onerror=alert(2)><b>$\\pi$</b> \x1b[31m\x07\ud800"
SHOWN = (
    "<script>alert(1)</script>\"'&amp;</td><img src=x onerror=alert(2)><b>$\\pi$</b> \\x1b[31m\\x07\\ud800"
)
"""The same as a reader should see it."""


@dataclass(frozen=True)
class Browser:
    """A browser window that takes note of everything a page tries."""

    driver: "webdriver.Chrome"

    def open(self, page: Path, width: int = 1400) -> None:
        """Show a file in a window of this width [CSS pixel], as a phone would if it is narrow."""
        self.resize(width)
        self.heard()
        from selenium.webdriver.support.wait import WebDriverWait

        self.driver.get(page.as_uri())
        # Beside other work the driver may return while a long page is still being read.
        WebDriverWait(self.driver, 30.0).until(
            lambda driver: driver.execute_script("return document.readyState") == "complete"
        )

    def resize(self, width: int) -> None:
        """Make the window this wide."""
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)

    def ask(self, script: str) -> Any:
        """What a script that returns something finds on the page."""
        return self.driver.execute_script(script)

    def heard(self) -> tuple[list[str], list[str]]:
        """Messages on the console, and addresses asked for besides the page's own data, since the last time."""
        console = [entry["message"] for entry in self.driver.get_log("browser")]
        events = [json.loads(entry["message"])["message"] for entry in self.driver.get_log("performance")]
        asked = [
            event["params"]["request"]["url"]
            for event in events
            if event["method"] == "Network.requestWillBeSent"
        ]
        return console, [url for url in asked if not url.startswith("data:")]

    def printed(self) -> bytes:
        """The page as PDF on the paper that it asks for."""
        found = self.driver.execute_cdp_cmd("Page.printToPDF", {"preferCSSPageSize": True})
        return b64decode(found["data"])

    def media(self, kind: str) -> None:
        """Pretend to be paper ("print") or a screen ("screen")."""
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": kind})


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Headless Chromium; the test is left out where there is none."""
    # Not among what the fast tests need.
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    steering = shutil.which("chromedriver")
    if program is None or steering is None:
        pytest.skip("no browser: needs chromium and chromedriver")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    # Containers have neither the rights for a sandbox nor a large shared memory; no name is ever resolved.
    for argument in (
        "headless=new",
        "no-sandbox",
        "disable-dev-shm-usage",
        "host-resolver-rules=MAP * ~NOTFOUND",
    ):
        options.add_argument(f"--{argument}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(steering))
    try:
        yield Browser(driver)
    finally:
        driver.quit()


@pytest.fixture(scope="session")
def posterior(nominal_campaign: Path) -> HarmonicPosterior:
    return synthetic_posterior(nominal_response(nominal_campaign), length=500)


@pytest.fixture(scope="session")
def page(posterior: HarmonicPosterior, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of a posterior that converged."""
    command = ("savgs-ident", "posterior", "model.toml", "campaign.csv.gz")
    origin = Origin(command, "campaign.csv.gz", "ab" * 32, "model.toml", {"savgs-ident": "0.1.0"})
    return _written(tmp_path_factory, posterior_html(posterior, origin))


@pytest.fixture(scope="session")
def hostile_page(posterior: HarmonicPosterior, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of one that did not, from data where every name is an attack."""
    named = renamed(replace(posterior, sentences=(HOSTILE,)), f"k{HOSTILE}", HOSTILE, HOSTILE)
    failed = unconverged(
        replace(named, model=replace(named.model, rig=replace(named.model.rig, name=HOSTILE))), HOSTILE
    )
    origin = Origin(("savgs-ident", HOSTILE), HOSTILE, HOSTILE, HOSTILE, {HOSTILE: HOSTILE})
    return _written(tmp_path_factory, posterior_html(failed, origin))


def _written(factory: pytest.TempPathFactory, html: str) -> Path:
    path = factory.mktemp("pages") / "posterior.html"
    path.write_text(html, encoding="utf-8")
    return path

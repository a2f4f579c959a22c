"""One comparison, its page and one browser for all tests of pages."""

import pytest
from page_helpers import FLAGS, Made, Opened, find_browser


@pytest.fixture(scope="session")
def nedc(tmp_path_factory):
    """The default comparison."""
    return Made(tmp_path_factory.mktemp("pages"), "nedc")


@pytest.fixture(scope="session")
def browser():
    """A real browser, headless."""
    program = find_browser()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def opened(browser):
    """(path, settings) -> the opened page; closed after the test."""
    pages = []

    def opened(path, **settings):
        pages.append(Opened(browser, path, **settings))
        return pages[-1]

    yield opened
    for page in pages:
        page.context.close()


@pytest.fixture(scope="session")
def shown(browser, nedc):
    """The default comparison, opened once at 1440 px; tests choose what they need on it first."""
    found = Opened(browser, nedc.path, viewport={"width": 1440, "height": 1400})
    yield found
    found.context.close()

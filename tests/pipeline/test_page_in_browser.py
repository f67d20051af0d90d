"""The page as a browser without a network shows it."""

import io
import shutil
from collections.abc import Iterator

import matplotlib.image
import numpy as np
import pytest
from playwright.sync_api import Error, Page, sync_playwright

from pipeline.report import make_report
from tests.pipeline.made_up_results import write_everything

pytestmark = pytest.mark.slow
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
SCENARIOS = ("modelnet40-unseen_objects", "3dmatch", "kitti")


@pytest.fixture(scope="module")
def messages() -> list[str]:
    """What the page complained about."""
    return []


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory, messages: list[str]) -> Iterator[Page]:
    executable = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if executable is None:
        pytest.skip(f"none of {', '.join(BROWSERS)} is on the PATH")
    folder = tmp_path_factory.mktemp("page")
    write_everything(folder, SCENARIOS, 5)
    parts = (folder / name for name in ("results", "models", "pairs"))
    file = folder / "index.html"
    file.write_text(make_report(*parts, profile="quick").page, encoding="utf-8")
    arguments = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch(executable_path=executable, args=arguments)
        except Error as error:
            pytest.skip(f"the browser does not start here: {error.message.splitlines()[0]}")
        context = browser.new_context(viewport={"width": 1366, "height": 900}, offline=True)
        opened = context.new_page()
        opened.on(
            "console", lambda said: messages.append(said.text) if said.type == "error" else None
        )
        opened.on("pageerror", lambda error: messages.append(str(error)))
        opened.on(
            "request", lambda asked: messages.append(asked.url) if asked.url[:4] == "http" else None
        )
        opened.goto(file.as_uri())
        opened.wait_for_function(
            "() => document.querySelectorAll('.turn canvas').length >= 6"
            " && document.querySelectorAll('#plot-curves-kitti, .plot .main-svg').length > 4"
        )
        yield opened
        browser.close()


def picture(page: Page, selector: str) -> np.ndarray:
    """Photograph an element: height by width by RGB, in [0, 1]."""
    content = page.locator(selector).screenshot()
    return np.asarray(matplotlib.image.imread(io.BytesIO(content), format="png"))[..., :3]


def share(image: np.ndarray, color: tuple[int, int, int]) -> float:
    """Measure the share of pixels that are nearly of a colour."""
    return float((np.abs(image - np.array(color) / 255).max(axis=-1) < 0.12).mean())


def test_nothing_is_wider_than_a_laptop(page: Page) -> None:
    assert page.evaluate("document.documentElement.scrollWidth") <= 1366
    wide = (
        "[...document.querySelectorAll('.scroll')].filter((e) => e.scrollWidth > e.clientWidth + 1)"
    )
    assert page.evaluate(f"{wide}.length") == 0


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_each_view_shows_its_clouds_in_their_colours(page: Page, scenario: str) -> None:
    image = picture(page, f"#plot-overlay-{scenario}")[40:]
    before, after = image[:, : image.shape[1] // 2], image[:, image.shape[1] // 2 :]
    blue, orange, green = (0, 114, 178), (230, 159, 0), (0, 158, 115)
    assert share(before, blue) > 2e-3
    assert share(before, orange) > 2e-3
    assert share(before, green) == 0
    assert share(after, green) > 2e-3
    assert share(after, blue) == 0


def test_a_button_shows_another_methods_registration(page: Page) -> None:
    card = page.locator(".card", has=page.locator("#plot-overlay-kitti"))
    before = picture(page, "#plot-overlay-kitti")
    card.get_by_role("button", name="ICP", exact=True).click()
    page.wait_for_timeout(500)
    assert "ICP: rotation off by" in (card.locator("strong").text_content() or "")
    assert not np.array_equal(before, picture(page, "#plot-overlay-kitti"))


def test_turning_one_view_turns_the_other(page: Page) -> None:
    moved = page.evaluate(
        """async () => {
            const plot = document.getElementById("plot-overlay-3dmatch");
            await Plotly.relayout(plot, {"scene.camera": {eye: {x: 0.5, y: 2, z: 1}}});
            await new Promise((done) => setTimeout(done, 300));
            return plot.layout.scene2.camera.eye.x;
        }"""
    )
    assert moved == 0.5


def test_a_hidden_panel_is_drawn_when_it_is_shown(page: Page) -> None:
    page.get_by_role("button", name="Translation").click()
    page.wait_for_selector("#plot-errors-translation .main-svg")
    assert page.locator("#panel-errors-rotation").is_hidden()
    page.locator("#curves").get_by_role("button", name="KITTI").click()
    page.wait_for_selector("#plot-curves-kitti .main-svg")
    page.get_by_role("button", name="Asymmetric shapes only").first.click()
    assert page.locator("#table-1a-modelnet40-unseen-objects--asymmetric").is_visible()


def test_the_page_never_complained_nor_asked_the_network(page: Page, messages: list[str]) -> None:
    assert page.locator("nav a").count() == 8
    assert messages == []

"""The page as a browser without a network shows it."""

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from playwright.sync_api import Browser, Locator, Page, ViewportSize

from pipeline.reporting.page import render_page
from tests.pipeline.browser import browser as browser
from tests.pipeline.browser import listen
from tests.pipeline.reporting.synthetic_page import make_contents

pytestmark = pytest.mark.slow
SCENARIOS = ("modelnet40-unseen_objects", "3dmatch", "kitti")
SECTIONS = ["pairs", "glance", "errors", "ablations", "steps", "starts", "speed", "difficulty"]
SECTIONS += [
    "distributions",
    "reliability",
    "curves",
    "overlays",
    "walks",
    "tables",
    "benchmarks",
    "provenance",
]
SECTIONS += ["reading", "findings"]
TALLEST = 12_000
"""Pixels, at the width of a laptop."""
TIMEOUT = 120_000
"""Milliseconds that an action may take: a busy machine draws a point cloud slowly in software."""

PAUSE = """(card) => new Promise((done) => {
    const timer = setInterval(() => {
        const step = Number(/^Step (\\d) of 8/.exec(card.querySelector(".walk-says").textContent)[1]);
        if (step < 3) return;
        clearInterval(timer);
        [...card.querySelectorAll("button")].find((e) => e.textContent.includes("Pause")).click();
        done();
    }, 10);
})"""
"""Stops a walk at its third step. It asks between two of the player's own beats, in the page: from
outside, a slow machine may see no step before the last."""


@dataclass(frozen=True)
class Opened:
    """The page's file, and what it has complained about since it was opened."""

    page: Page
    file: Path
    said: list[str]


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory, browser: Browser) -> Iterator[Opened]:
    folder = tmp_path_factory.mktemp("page")
    file = folder / "index.html"
    file.write_text(render_page(make_contents(folder, SCENARIOS, 5)), encoding="utf-8")
    context = browser.new_context(viewport={"width": 1366, "height": 900}, offline=True)
    context.set_default_timeout(TIMEOUT)
    page = context.new_page()
    said = listen(page)
    page.goto(file.as_uri())
    yield Opened(page, file, said)
    context.close()


@pytest.fixture
def page(opened: Opened) -> Iterator[Page]:
    """The page with no filter and no order of one's own, wherever an earlier test left it."""
    yield opened.page
    opened.page.get_by_role("button", name="Show all").click()


def see(page: Page, plot: str) -> Locator:
    """Bring a plot's panel to the front and scroll to it, which draws it."""
    found = page.locator(f"#{plot}")
    panel = "(e) => e.closest('[id^=panel-]')?.id"
    if found.is_hidden() and (name := found.evaluate(panel)):
        page.locator(f"button[data-panel='{name}']").click()
    found.scroll_into_view_if_needed()
    page.wait_for_selector(f"#{plot} .main-svg")
    if "overlay" in plot or "walk" in plot:
        page.wait_for_selector(f"#{plot} canvas")
        page.wait_for_timeout(700)
    return found


def picture(page: Page, plot: str) -> np.ndarray:
    """Photograph a plot: height by width by RGB, in [0, 1]."""
    content = see(page, plot).screenshot()
    return np.asarray(matplotlib.image.imread(io.BytesIO(content), format="png"))[..., :3]


def share(image: np.ndarray, color: tuple[int, int, int]) -> float:
    """Measure the share of pixels that are nearly of a colour."""
    return float((np.abs(image - np.array(color) / 255).max(axis=-1) < 0.12).mean())


def shown_rows(table: Locator) -> list[str]:
    """List the methods whose rows a table shows, from the top."""
    rows = "(rows) => rows.filter((row) => row.offsetParent).map((row) => row.dataset.method)"
    methods: list[str] = table.locator("tbody tr").evaluate_all(rows)
    return methods


def values(table: Locator, column: int) -> list[float]:
    """List the values of a column from the top."""
    read = f"(rows) => rows.map((row) => Number(row.cells[{column}].dataset.value))"
    numbers: list[float] = table.locator("tbody tr").evaluate_all(read)
    return numbers


def test_the_page_is_no_taller_than_a_few_screens_and_in_its_order(page: Page) -> None:
    order = page.locator("main section").evaluate_all("(all) => all.map((e) => e.id)")
    assert order == SECTIONS
    assert page.locator("nav a").evaluate_all("(all) => all.map((e) => e.hash.slice(1))") == order
    for section in order:
        page.locator(f"#{section}").scroll_into_view_if_needed()
        page.wait_for_timeout(100)
    assert page.evaluate("document.documentElement.scrollHeight") <= TALLEST


def test_the_first_screen_shows_pictures_and_the_table_at_a_glance(page: Page) -> None:
    page.evaluate("scrollTo(0, 0)")
    loaded = "(all) => all.filter((e) => e.complete && e.naturalWidth > 100).length"
    assert page.locator("#pairs img").evaluate_all(loaded) == len(SCENARIOS)
    banner = page.locator(".banner").bounding_box()
    assert banner
    assert banner["y"] + banner["height"] <= 60
    glance = page.locator("#glance table").bounding_box()
    assert glance
    assert glance["y"] < 700


def test_nothing_is_wider_than_a_phone(opened: Opened, browser: Browser) -> None:
    size: ViewportSize = {"width": 390, "height": 844}
    context = browser.new_context(viewport=size, offline=True)
    phone = context.new_page()
    said = listen(phone)
    phone.goto(opened.file.as_uri())
    assert phone.evaluate("document.documentElement.scrollWidth") <= 390
    phone.locator("#errors").scroll_into_view_if_needed()
    phone.wait_for_selector("#errors .main-svg")
    assert phone.evaluate("document.documentElement.scrollWidth") <= 390
    assert said == []
    context.close()


def test_a_chart_in_a_fold_is_drawn_as_wide_as_the_fold_when_it_opens(page: Page) -> None:
    fold = page.locator("details", has=page.locator("#plot-bench-latency"))
    assert page.locator("#plot-bench-latency .main-svg").count() == 0
    fold.locator("summary").click()
    page.wait_for_selector("#plot-bench-latency .main-svg")
    drawn = page.locator("#plot-bench-latency .main-svg").first.bounding_box()
    around = page.locator("#plot-bench-latency").bounding_box()
    assert drawn
    assert around
    assert drawn["width"] == pytest.approx(around["width"], abs=2)
    assert drawn["width"] > 1000
    fold.locator("summary").click()


def test_a_link_to_a_folded_table_opens_it(page: Page) -> None:
    table = page.locator("#table-2-kitti")
    assert table.locator("table").first.is_hidden()
    page.locator("#glance thead a").last.click()
    page.wait_for_selector("#table-2-3dmatch table")
    page.locator("#glance a[href='#table-2-kitti']").click()
    assert table.locator("table").first.is_visible()


def test_nothing_is_wider_than_a_laptop(page: Page) -> None:
    assert page.evaluate("document.documentElement.scrollWidth") <= 1366
    page.evaluate("document.querySelectorAll('details.fold').forEach((e) => { e.open = true; })")
    wide = "(all) => all.filter((e) => e.scrollWidth > e.clientWidth + 1).length"
    assert page.locator(".scroll").evaluate_all(wide) == 0
    page.evaluate("document.querySelectorAll('details.fold').forEach((e) => { e.open = false; })")


def test_every_plot_is_drawn_when_it_comes_into_sight(page: Page) -> None:
    names: list[str] = page.locator(".plot:visible").evaluate_all("(all) => all.map((e) => e.id)")
    assert {
        "plot-steps",
        "plot-speed",
        "plot-ablation-representation",
        f"plot-walk-{SCENARIOS[0]}",
    } <= {*names}
    for name in names:
        see(page, name)
    assert page.evaluate("document.documentElement.scrollWidth") <= 1366


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_each_view_shows_its_clouds_in_their_colours(page: Page, scenario: str) -> None:
    image = picture(page, f"plot-overlay-{scenario}")[40:]
    before, after = image[:, : image.shape[1] // 2], image[:, image.shape[1] // 2 :]
    blue, orange, green = (0, 114, 178), (230, 159, 0), (0, 158, 115)
    assert share(before, blue) > 2e-3
    assert share(before, orange) > 2e-3
    assert share(before, green) == 0
    assert share(after, green) > 2e-3
    assert share(after, blue) == 0


def test_buttons_show_another_pair_and_another_methods_registration(page: Page) -> None:
    card = page.locator(".overlay", has=page.locator("#plot-overlay-kitti"))
    says, which = card.locator(".says"), card.locator(".which")
    median, before = which.text_content(), picture(page, "plot-overlay-kitti")
    card.get_by_role("button", name="worst").click()
    assert which.text_content() != median
    worst = says.text_content()
    assert (worst or "").startswith("PCRDiffusion CB: rotation off by")
    card.get_by_role("button", name="ICP", exact=True).click()
    assert (says.text_content() or "").startswith("ICP: rotation off by")
    assert not np.array_equal(before, picture(page, "plot-overlay-kitti"))
    card.get_by_role("button", name="median").click()
    card.get_by_role("button", name="PCRDiffusion CB", exact=True).click()
    assert which.text_content() == median


def test_the_green_cloud_lies_where_the_pose_puts_the_source(page: Page) -> None:
    see(page, "plot-overlay-3dmatch")
    off = page.evaluate(
        """() => {
            const plot = document.getElementById("plot-overlay-3dmatch");
            const {pair, poses} = SCENES.examples["3dmatch"].median;
            const T = poses.pcrdiffusion_cb.pose, source = SCENES.clouds[`3dmatch/${pair}`].source;
            const y = source[0].map((_, i) => T[4] * source[0][i] + T[5] * source[1][i] + T[6] * source[2][i] + T[7]);
            return Math.max(...y.map((value, i) => Math.abs(value - plot.data[3].y[i])));
        }"""
    )
    assert off < 1e-9


def test_a_drag_turns_both_views(page: Page) -> None:
    box = see(page, "plot-overlay-3dmatch").bounding_box()
    assert box
    read = (
        "(name) => document.getElementById('plot-overlay-3dmatch')"
        "._fullLayout[name]._scene.getCamera().eye.x"
    )
    before = page.evaluate(read, "scene")
    x, y = box["x"] + box["width"] / 4, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 9):
        page.mouse.move(x + 15 * step, y + 3 * step)
    page.mouse.up()
    page.wait_for_timeout(600)
    after = page.evaluate(read, "scene")
    assert abs(after - before) > 0.05
    assert page.evaluate(read, "scene2") == pytest.approx(after, abs=1e-3)


def test_a_turned_view_stays_so_under_another_method(page: Page) -> None:
    see(page, "plot-overlay-kitti")
    read = (
        "() => document.getElementById('plot-overlay-kitti')"
        "._fullLayout.scene._scene.getCamera().eye.x"
    )
    page.evaluate(
        "Plotly.relayout('plot-overlay-kitti', {'scene.camera': {eye: {x: .5, y: 2, z: 1}}})"
    )
    card = page.locator(".overlay", has=page.locator("#plot-overlay-kitti"))
    card.get_by_role("button", name="FGR", exact=True).click()
    page.wait_for_timeout(400)
    assert page.evaluate(read) == pytest.approx(0.5, abs=1e-3)
    card.get_by_role("button", name="PCRDiffusion CB", exact=True).click()


def test_a_walk_plays_to_its_end_and_the_slider_goes_back(page: Page) -> None:
    plot = "plot-walk-kitti"
    before = picture(page, plot)
    card = page.locator(".walker", has=page.locator(f"#{plot}"))
    says = card.locator(".walk-says")
    assert "Step 1 of 8, t = 1000: prediction" in (says.text_content() or "")
    card.get_by_role("button", name="Play").click()
    card.evaluate(PAUSE)
    held = says.text_content()
    page.wait_for_timeout(1000)
    assert says.text_content() == held
    assert not np.array_equal(before, picture(page, plot))
    slider = card.get_by_role("slider")
    slider.fill("7")
    last = re.search(r"off by ([\d.]+)° and ([\d.]+) \(m\)", says.text_content() or "")
    slider.fill("0")
    first = re.search(r"off by ([\d.]+)° and ([\d.]+) \(m\)", says.text_content() or "")
    assert first
    assert last
    assert float(first[1]) > float(last[1]) + 5
    assert float(first[2]) > float(last[2])


def test_a_walk_of_another_method_and_pair_can_be_chosen(page: Page) -> None:
    card = page.locator(".walker", has=page.locator("#plot-walk-kitti"))
    card.locator("input").fill("3")
    card.get_by_label("Method").select_option(label="PCRDiffusion CF")
    card.get_by_label("Test pair").select_option("1")
    assert "Step 1 of 8" in (card.locator(".walk-says").text_content() or "")
    assert card.get_by_label("Method").input_value() == "pcrdiffusion_cf"


def test_a_hidden_panel_is_drawn_when_it_is_shown(page: Page) -> None:
    page.locator("#errors").get_by_role("button", name="Translation").click()
    page.wait_for_selector("#plot-error_t-kitti .main-svg")
    assert page.locator("#panel-error_r_deg").is_hidden()
    page.locator("#errors").get_by_role("button", name="Rotation").click()
    page.locator("#curves").get_by_role("button", name="KITTI").click()
    page.wait_for_selector("#plot-curves-kitti .main-svg")
    page.locator("#table-1a-modelnet40-unseen-objects > summary").click()
    page.get_by_role("button", name="Asymmetric shapes only").first.click()
    assert page.locator("#table-1a-modelnet40-unseen-objects-asymmetric").is_visible()
    page.get_by_role("button", name="All shapes").first.click()


def test_a_column_sorts_up_then_down_then_back(page: Page) -> None:
    page.locator("#glance a[href='#table-2-kitti']").click()
    table = page.locator("#table-2-kitti-all table")
    order = shown_rows(table)
    head = table.locator("thead th").nth(5)
    button = head.get_by_role("button")
    button.click()
    assert head.get_attribute("aria-sort") == "ascending"
    rising = values(table, 5)
    assert rising == sorted(rising)
    assert shown_rows(table) != order
    assert shown_rows(table).index("icp_centroid") == 0, "floors sort along"
    assert table.locator("tbody tr.floor").count() == 3, "and stay marked"
    button.focus()
    page.keyboard.press("Enter")
    assert head.get_attribute("aria-sort") == "descending"
    assert values(table, 5) == rising[::-1]
    table.locator("thead th").nth(4).get_by_role("button").click()
    assert head.get_attribute("aria-sort") == "none"
    button.click()
    button.click()
    button.click()
    assert shown_rows(table) == order


def test_every_column_of_every_table_has_a_button_to_sort_by(page: Page) -> None:
    heads = page.locator("thead th")
    assert heads.count() > 40
    bare = "(all) => all.filter((e) => !e.querySelector('button.sort') || !e.hasAttribute('aria-sort')).length"
    assert heads.evaluate_all(bare) == 0


def test_the_filter_hides_other_data_sets_and_methods(page: Page, opened: Opened) -> None:
    glance = page.locator("#glance table")
    everything = shown_rows(glance)
    page.get_by_label("Data set").select_option("kitti")
    assert page.locator("#table-2-kitti").is_visible()
    assert page.locator("#table-1a-modelnet40-unseen-objects").is_hidden()
    assert glance.locator("thead th:visible").count() == 2
    assert page.locator("#plot-overlay-3dmatch").is_hidden()
    assert "passes the filter" in page.evaluate(
        "getComputedStyle(document.getElementById('steps'), '::after').content"
    )
    page.get_by_label("floors").uncheck()
    page.get_by_text("Methods", exact=True).click()
    page.get_by_label("FGR").uncheck()
    page.keyboard.press("Escape")
    assert page.get_by_label("FGR").is_hidden()
    gone = {"identity", "constant", "icp_centroid", "fgr"}
    assert {*everything} - {*shown_rows(glance)} == gone
    assert gone.isdisjoint(shown_rows(page.locator("#table-2-kitti-all table")))
    see(page, "plot-error_r_deg-kitti")
    names = page.evaluate(
        "document.getElementById('plot-error_r_deg-kitti').data.flatMap((trace) => trace.y)"
    )
    assert "ICP" in names
    assert not {"FGR", "Identity"} & {*names}
    assert "scenario=kitti" in page.evaluate("location.hash")
    again = opened.page.context.new_page()
    again.goto(page.url)
    assert shown_rows(again.locator("#glance table")) == shown_rows(glance)
    assert again.get_by_label("Data set").input_value() == "kitti"
    again.close()
    page.get_by_role("button", name="Show all").click()
    assert shown_rows(glance) == everything
    assert "scenario=kitti" not in page.evaluate("location.hash")
    assert page.locator("#table-1a-modelnet40-unseen-objects").is_visible()


def test_a_link_within_the_page_keeps_the_filter(page: Page) -> None:
    page.get_by_label("Data set").select_option("3dmatch")
    page.get_by_role("link", name="Provenance").click()
    page.wait_for_function("location.hash === '#provenance?scenario=3dmatch'")
    assert page.get_by_label("Data set").input_value() == "3dmatch"
    page.wait_for_function(
        "document.getElementById('provenance').getBoundingClientRect().top < 300"
    )


def test_the_claims_come_last_with_verdicts_in_words_and_open_on_a_click(page: Page) -> None:
    findings = page.locator("#findings")
    assert findings.locator(".verdict").all_text_contents() == [
        "✓confirmed",
        "✗not confirmed",
        "?undecided",
        "○not run",
    ]
    first = findings.locator("details").first
    assert first.locator("li").is_hidden()
    first.locator("summary").click()
    assert first.locator("li").is_visible()


def test_the_page_never_complained_nor_asked_the_network(opened: Opened) -> None:
    assert opened.said == []

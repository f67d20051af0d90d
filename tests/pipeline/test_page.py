"""The page: everything in one file, warnings first, nothing of this machine in it."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from pipeline.page import flatten
from pipeline.report import make_report
from tests.pipeline.made_up_results import plain_row, write_everything, write_rows


class Elements(HTMLParser):
    """Collects the ids, the links within the page and the addresses an element would fetch."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.anchors: list[str] = []
        self.fetched: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note one element."""
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name == "href" and (value or "").startswith("#"):
                self.anchors.append((value or "")[1:])
            elif name in ("src", "href") and not (value or "").startswith("data:"):
                self.fetched.append(f"{tag} {value}")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made_up")
    write_everything(folder, ("modelnet40-unseen_objects", "kitti"), 5)
    return folder


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return render(folder, "quick")


def render(folder: Path, profile: str) -> str:
    parts = (folder / name for name in ("results", "models", "pairs"))
    return make_report(*parts, profile=profile).page


def test_the_page_is_the_same_twice(folder: Path, page: str) -> None:
    assert render(folder, "quick") == page


def test_the_page_fetches_nothing_and_stays_small(page: str) -> None:
    assert Elements(page).fetched == []
    assert "@import" not in page.split("</style>")[0]
    assert len(page.encode()) < 8_000_000


def test_every_link_within_the_page_leads_somewhere(page: str) -> None:
    elements = Elements(page)
    assert len(elements.ids) == len({*elements.ids})
    assert {*elements.anchors} <= {*elements.ids}
    assert len(elements.anchors) > 20


def test_every_figure_has_its_place_and_every_place_its_figure(page: str) -> None:
    found = re.search(r'<script type="application/json" id="figures">(.*?)</script>', page, re.S)
    assert found
    places = {name for name in Elements(page).ids if name.startswith("plot-")}
    assert {*json.loads(found[1])} == places
    assert {"plot-overlay-kitti", "plot-steps", "plot-errors-rotation"} <= places


def test_a_quick_run_says_so_at_the_top(page: str) -> None:
    body = page.split("<body>")[1]
    assert body.index("quick profile: not a reproduction") < body.index("<nav")


def test_nothing_of_this_machine_is_in_the_page(folder: Path, page: str) -> None:
    written = page.replace(page[page.index("<script>") : page.index("</script>")], "")
    assert str(folder) not in written
    assert "/somewhere/raw" not in written


def test_provenance_is_listed_leaf_by_leaf_without_paths() -> None:
    provenance = {
        "source": "local",
        "root": "/home/someone/data",
        "windows": "C:\\data",
        "pose": {"max_rotation_deg": 45.0, "axes": [0, 1]},
        "archives": [{"sha256": "0" * 64}, {"sha256": "1" * 64}],
    }
    assert flatten(provenance) == {
        "archives": "2 entries",
        "pose.axes": "[0, 1]",
        "pose.max_rotation_deg": "45.0",
        "source": "local",
    }


def test_text_from_files_cannot_become_markup(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    for file in (tmp_path / "results").glob("*/*.csv"):
        text = re.sub("airplane|bottle|chair", "<b>group</b>", file.read_text())
        file.write_text(text)
    for file in (tmp_path / "models").glob("*/*cb.json"):
        file.rename(file.with_name("<i>method<.json"))
        file.with_suffix(".csv").rename(file.with_name("<i>method<.csv"))
    page = render(tmp_path, "quick")
    assert "<b>group</b>" not in page
    assert "&lt;b&gt;group&lt;/b&gt;" in page
    assert "<i>" not in page.split("<script>")[0]


def test_a_report_without_trainings_or_ablations_is_still_a_report(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    parts = (tmp_path / "results", tmp_path / "no_models", tmp_path / "pairs")
    page = make_report(*parts, profile="quick").page
    assert 'id="curves"' not in page
    assert 'id="steps"' not in page


def test_a_glance_keeps_the_order_of_the_rows_also_for_methods_without_a_paper_setting(
    tmp_path: Path,
) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    rows = [plain_row(pair, off_deg=1.0) | {"setting": "official"} for pair in range(3)]
    write_rows(tmp_path / "results" / "kitti" / "gicp.csv", rows)
    text = render(tmp_path, "quick")
    glance = text[text.index('<section id="glance">') : text.index('<section id="errors">')]
    places = [glance.index(name) for name in (">ICP<", ">Generalized ICP<", ">PCRDiffusion CB<")]
    assert places == sorted(places)

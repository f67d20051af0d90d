"""The page: everything in one file, warnings first, nothing of this machine in it."""

import json
import re
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from pipeline.reporting.page import Contents, flatten, render_page
from pipeline.reporting.paper import FLOORS
from pipeline.reporting.provenance import read_provenance
from pipeline.reporting.report import make_contents as make_the_contents
from pipeline.reporting.report import make_report
from tests.pipeline.reporting.synthetic_page import make_contents
from tests.pipeline.reporting.synthetic_results import (
    plain_row,
    result_file,
    write_everything,
    write_rows,
)


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
    folder = tmp_path_factory.mktemp("synthetic")
    write_everything(folder, ("modelnet40-unseen_objects", "kitti"), 5)
    return folder


@pytest.fixture(scope="module")
def page(folder: Path) -> str:
    return render(folder, "quick")


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> Contents:
    return make_contents(tmp_path_factory.mktemp("full"), ("modelnet40-unseen_objects", "kitti"), 5)


@pytest.fixture(scope="module")
def full(contents: Contents) -> str:
    return render_page(contents)


def render(folder: Path, profile: str) -> str:
    parts = (folder / name for name in ("results", "models", "pairs", "benchmarks"))
    return make_report(make_the_contents(*parts, profile=profile)).page


def test_the_page_is_the_same_twice(folder: Path, page: str, contents: Contents, full: str) -> None:
    assert render(folder, "quick") == page
    assert render_page(contents) == full


def test_the_page_fetches_nothing_and_stays_small(full: str) -> None:
    assert Elements(full).fetched == []
    assert "@import" not in full.split("</style>")[0]
    assert len(full.encode()) < 8_000_000


@pytest.mark.parametrize("which", ["page", "full"])
def test_every_link_within_the_page_leads_somewhere(
    which: str, request: pytest.FixtureRequest
) -> None:
    page = request.getfixturevalue(which)
    elements = Elements(page)
    assert len(elements.ids) == len({*elements.ids})
    assert {*elements.anchors} <= {*elements.ids}
    assert len(elements.anchors) > 20


@pytest.mark.parametrize("which", ["page", "full"])
def test_every_figure_has_its_place_and_every_place_its_figure(
    which: str, request: pytest.FixtureRequest
) -> None:
    page = request.getfixturevalue(which)
    found = re.search(r'<script type="application/json" id="figures">(.*?)</script>', page, re.S)
    assert found
    places = {name for name in Elements(page).ids if name.startswith("plot-")}
    clouds = {name for name in places if name.startswith(("plot-overlay-", "plot-walk-"))}
    assert {*json.loads(found[1])} == places - clouds
    assert {"plot-overlay-kitti", "plot-walk-kitti"} <= clouds
    assert {"plot-steps", "plot-error_r_deg-kitti"} <= places


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
    for file in (tmp_path / "results").glob("*/kitti.csv"):
        text = re.sub("airplane|bottle|chair", "<b>group</b>", file.read_text())
        file.write_text(text)
    for file in (tmp_path / "models").glob("pcrdiffusion_cb/*/facts.json"):
        file.write_text(file.read_text().replace('"pcrdiffusion_cb"', '"<i>method<"'))
    page = render(tmp_path, "quick")
    assert "<b>group</b>" not in page
    assert "&lt;b&gt;group&lt;/b&gt;" in page
    assert "<i>" not in page.split("<script>")[0]


def test_a_report_without_trainings_or_ablations_is_still_a_report(tmp_path: Path) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    parts = (tmp_path / name for name in ("results", "no_models", "pairs", "benchmarks"))
    page = make_report(make_the_contents(*parts, profile="quick")).page
    absent = "ablations", "steps", "starts", "speed", "difficulty", "reliability", "curves"
    for section in (*absent, "findings"):
        assert f'id="{section}"' not in page
        assert f'href="#{section}"' not in page


def test_a_glance_keeps_the_order_of_the_rows_also_for_methods_without_a_paper_setting(
    tmp_path: Path,
) -> None:
    write_everything(tmp_path, ("kitti",), 3)
    rows = [plain_row(pair, off_deg=1.0) | {"setting": "official"} for pair in range(3)]
    write_rows(result_file(tmp_path / "results", "kitti", "gicp"), rows)
    text = render(tmp_path, "quick")
    glance = text[text.index('<section id="glance">') : text.index('<section id="errors">')]
    places = [glance.index(name) for name in (">ICP<", ">Generalized ICP<", ">PCRDiffusion CB<")]
    assert places == sorted(places)


def test_each_claim_is_a_line_with_its_verdict_and_our_numbers_behind_it(full: str) -> None:
    section = full[full.index('<section id="findings">') :]
    assert section.count("<summary>") == 4
    folded = section[section.index("not-confirmed") :]
    assert '<span aria-hidden="true">✗</span>not confirmed</span>diffusion</summary>' in folded
    assert "Without diffusion CF falls from 3.2786 to 168.0197 deg." in folded
    assert "<li>Ours falls from 4.02 deg [3.51, 4.55] to 4.40 deg [3.90, 4.93].</li>" in folded


def test_the_page_goes_from_pictures_over_numbers_to_claims(full: str) -> None:
    assert re.findall(r'<section id="(.*?)">', full) == [
        "pairs", "glance", "errors", "ablations", "steps", "starts", "speed", "difficulty",
        "distributions", "reliability", "curves", "overlays", "walks", "tables", "benchmarks", "provenance",
        "reading", "findings",
    ]  # fmt: skip


def test_under_the_chart_of_starts_stands_what_each_source_is_worth(full: str) -> None:
    section = full[full.index('<section id="starts">') : full.index('<section id="speed">')]
    assert section.count("A source is worth the starts that it saves: read how many") == 2
    assert section.count("<li>PCRDiffusion CF: 1 sample finds ") == 2
    assert "<li>PCRDiffusion CB moved, one step: 1 sample finds " in section


def test_the_page_opens_with_a_picture_of_each_data_set(full: str) -> None:
    section = full[full.index('<section id="pairs">') : full.index('<section id="glance">')]
    assert section.count('<img src="data:image/png;base64,') == 2
    assert section.count("PCRDiffusion CB: rotation off by") == 2


def test_the_best_of_each_scenario_is_marked_at_a_glance(contents: Contents, full: str) -> None:
    glance = full[full.index('<section id="glance">') : full.index('<section id="errors">')]
    marked = re.findall(r'data-scenario="(.*?)" data-value="([\d.e-]+)"[^>]*class="best"', glance)
    main = contents.numbers[contents.numbers["headline"] & (contents.numbers["subset"] == "all")]
    main = main[(main["metric"] == "error_r_deg") & ~main["method"].isin(FLOORS)]
    smallest = main.groupby("scenario")["value"].min().to_dict()
    assert {name: float(value) for name, value in marked} == smallest


@pytest.mark.parametrize("profile", ["quick", "tables", "real", "paper"])
def test_claims_are_weighed_on_real_data_and_at_the_papers_size_only(
    folder: Path, profile: str
) -> None:
    parts = (folder / name for name in ("results", "models", "pairs", "benchmarks"))
    made = make_report(make_the_contents(*parts, profile=profile))
    page, markdown = made.page.split("<body>")[1], made.tables["results.md"]
    weighed = profile in ("real", "paper")
    elsewhere = "claims are weighed in the report on real data, {}reports/real/results.md{};"
    assert (elsewhere.format("", "") in page) != weighed
    assert (elsewhere.format("`", "`") in markdown) != weighed
    assert ('id="findings"' in page) == ('class="verdict ' in page) == weighed
    assert ("What we found" in page) == ("## What we found" in markdown) == weighed


def test_trust_stands_beside_the_verdict_that_it_comes_from(full: str) -> None:
    section = full[full.index('<section id="reliability">') : full.index('<section id="curves">')]
    assert (
        "fitted to the method&#39;s answers to the validation pairs of the same scenario" in section
    )
    rows = re.findall(
        r'<tr class="classical" data-method="gicp_multistart">(.*?)</tr>', section, re.S
    )
    assert len(rows) == 4  # two scenarios, two settings
    fast, official = (re.sub(r"<.*?>", " ", row).split() for row in rows[:2])
    assert fast[-4:] == ["nothing", "20", "15", "right"]
    assert official[-4:] == ["0.250", "20", "15", "right"]
    assert "0.0" in fast  # of them none is trusted


def test_clouds_are_in_the_page_once_and_poses_are_twelve_numbers(full: str) -> None:
    found = re.search(r'<script type="application/json" id="scenes">(.*?)</script>', full, re.S)
    assert found
    scenes = json.loads(found[1])
    assert {*scenes["examples"]["kitti"]} == {"best", "median", "worst"}
    shown = {f"kitti/{one['pair']}" for one in scenes["examples"]["kitti"].values()}
    walked = {f"kitti/{one['pair']}" for one in scenes["walks"]["kitti"]}
    assert {name for name in scenes["clouds"] if name.startswith("kitti/")} == shown | walked
    assert all(len(cloud["source"]) == 3 for cloud in scenes["clouds"].values())
    poses = scenes["examples"]["kitti"]["worst"]["poses"]
    assert len(poses) > 15
    assert {len(one["pose"]) for one in poses.values()} == {12}


def test_a_page_without_walks_has_no_part_for_them(contents: Contents) -> None:
    page = render_page(replace(contents, walks={}))
    assert 'id="walks"' not in page
    assert 'href="#walks"' not in page


def test_a_script_element_cannot_be_ended_by_its_data(contents: Contents) -> None:
    named = [replace(one, group="</script><!--x") for one in contents.examples]
    page = render_page(replace(contents, examples=named))
    assert "</script><!--" not in page
    assert "<!--x" not in page


def test_provenance_names_revision_changes_digests_and_ablation_trainings(full: str) -> None:
    section = full[full.index('<section id="provenance">') : full.index('<section id="reading">')]
    for said in (
        "0123456789abcdef0123456789abcdef01234567",
        "<strong>with uncommitted changes</strong> in params.yaml",
        "d" * 32,
        "Python 3.11.9, numpy 2.0.0, torch 2.4.0",
        "representation=euler,scaling=raw",
        "6 epochs, 228 steps",
    ):
        assert said in section
    assert "not recorded" not in section


def test_a_page_made_outside_git_and_dvc_says_so(contents: Contents, tmp_path: Path) -> None:
    known = read_provenance(tmp_path)
    assert (known.revision, known.changed, known.digests) == (None, (), {})
    for provenance in (known, None):
        page = render_page(replace(contents, provenance=provenance))
        assert "Git revision: not recorded." in page
        assert "Digests: not recorded." in page


def test_provenance_is_read_from_git_and_the_lock(tmp_path: Path) -> None:
    def git(*words: str) -> None:
        identity = ("-c", "user.name=test", "-c", "user.email=test@localhost")
        subprocess.run(["git", *identity, *words], cwd=tmp_path, check=True)

    (tmp_path / "params.yaml").write_text("seed: 7\n")
    (tmp_path / "README.md").write_text("a\n")
    git("init", "--quiet")
    git("add", "--all")
    git("commit", "--quiet", "-m", "start")
    clean = read_provenance(tmp_path)
    assert re.fullmatch(r"[0-9a-f]{40}", clean.revision or "")
    assert clean.changed == ()
    (tmp_path / "README.md").write_text("b\n")
    (tmp_path / "params.yaml").write_text("seed: 8\n")
    (tmp_path / "stages").mkdir()
    (tmp_path / "stages" / "new.py").write_text("")
    outs = [
        {"path": "data/pairs/kitti.h5", "md5": "a" * 32},
        {"path": "reports/x", "md5": "b" * 32},
    ]
    (tmp_path / "dvc.lock").write_text(json.dumps({"stages": {"preprocess@kitti": {"outs": outs}}}))
    known = read_provenance(tmp_path)
    assert known.changed == ("params.yaml", "stages/new.py")
    assert known.digests == {"data/pairs/kitti.h5": "a" * 32}
    assert "torch" in known.packages

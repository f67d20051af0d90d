"""The ablation of starts, from its files to the page: who finds how many pairs from how many."""

import re
from pathlib import Path

import pandas as pd
import pytest

from pipeline.formats.weights import SHIPPED
from pipeline.reporting.charts import starts_chart
from pipeline.reporting.claims import weigh_sources
from pipeline.reporting.documents import render_latex, render_markdown
from pipeline.reporting.reading import Training, choose, read_answers, read_times
from pipeline.reporting.tables import Table, make_tables
from tests.pipeline.reporting.synthetic_results import plain_row, write_rows, write_starts
from tests.pipeline.reporting.test_numbers import numbers_of, pick
from tests.pipeline.reporting.test_tables import file_of

SCENARIOS = ("modelnet40-partial", "kitti")
FOUND = {
    "gicp_multistart": {"starts=1": 1, "starts=2": 2, "starts=16": 6},
    "icp": {"starts=1": 8},
    "pcrdiffusion_cf": {"paper,starts=1": 2, "paper,starts=4": 6},
    "pcrdiffusion_cb_moved": {"four_steps,starts=4": 7},
}
"""Of ten pairs, those that are off by less than 5 degrees."""
TIMES = "times/starts.csv"


def write_found(folder: Path, scenario: str, found: dict[str, dict[str, int]] = FOUND) -> Path:
    rows = [
        {"method": method, **plain_row(pair, off_deg=1 + 10 * (pair >= count)), "setting": setting}
        for method, settings in found.items()
        for setting, count in settings.items()
        for pair in range(10)
    ]
    return write_rows(folder / "ablations" / "starts" / f"{scenario}.csv", rows)


def tables_of(numbers: pd.DataFrame) -> list[Table]:
    return make_tables(numbers, [], {name: file_of(name) for name in SCENARIOS})


@pytest.fixture(scope="module")
def numbers(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    """Numbers of the ablation on two scenarios, with times on the first."""
    folder = tmp_path_factory.mktemp("synthetic")
    write_starts(folder, SCENARIOS, 8)
    return numbers_of(folder)


def test_a_line_is_of_a_source_and_a_number_of_starts_on_a_scenario(tmp_path: Path) -> None:
    for scenario in SCENARIOS:
        write_found(tmp_path, scenario)
    place = {"scenario": "kitti", "method": "pcrdiffusion_cf", "starts": "4", "table": "extra"}
    found = choose(numbers_of(tmp_path), **place, ablation="starts").set_index("metric")
    assert {*found["setting"]} == {"paper,starts=4"}
    assert not found["headline"].any()
    assert found.loc["error_r_deg", "value"] == pytest.approx(0.6 * 2 + 0.4 * 22)
    assert found.loc["median_error_r_deg", "value"] == 2
    share = found.loc["below_5_deg_percent"]
    assert share["low"] < share["value"] == 60 < share["high"]


def test_times_are_those_of_their_settings_and_leave_table_6_alone(numbers: pd.DataFrame) -> None:
    seconds = pick(
        numbers, method="gicp_multistart", setting="starts=2", metric="seconds", subset="all"
    )
    assert tuple(seconds[["table", "scenario", "value"]]) == ("extra", SCENARIOS[0], 2.0)
    assert not (numbers["table"] == "6").any()


@pytest.mark.parametrize("setting", ["paper", "starts=0", "starts=many", "starts=4,paper"])
def test_refuses_a_setting_that_does_not_say_how_many(tmp_path: Path, setting: str) -> None:
    row = {"method": "icp", **plain_row(0), "setting": setting}
    write_rows(tmp_path / "ablations" / "starts" / "kitti.csv", [row])
    with pytest.raises(ValueError, match=r"starts/kitti\.csv needs settings like starts=4"):
        read_answers(tmp_path)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"setting": "paper"}, "needs settings like starts=4"),
        ({"seconds": "soon"}, "needs a finite number in column seconds"),
        ({"seconds": "0"}, "needs times above zero"),
        ({"guess": "1"}, "has columns nobody here reads: guess"),
    ],
)
def test_refuses_times_that_are_none(tmp_path: Path, changed: dict[str, str], said: str) -> None:
    row = {"method": "icp", "pair": 0, "setting": "starts=4", "seconds": "1"}
    write_rows(tmp_path / TIMES, [row | {"peak_memory_mib": "1"} | changed])
    with pytest.raises(ValueError, match=rf"starts\.csv {said}"):
        read_times(tmp_path)


def test_refuses_a_scenario_cut_short(tmp_path: Path) -> None:
    file = write_found(tmp_path, "kitti")
    file.write_text("".join(file.read_text().splitlines(keepends=True)[:-1]))
    with pytest.raises(ValueError, match=r"starts/kitti\.csv needs all 10 pairs"):
        read_answers(tmp_path)


def test_a_table_has_a_line_for_each_source_and_a_column_for_each_number(
    numbers: pd.DataFrame,
) -> None:
    tables = tables_of(numbers)
    assert [(t.scenario, t.subset, t.metric) for t in tables] == [
        (SCENARIOS[0], "all", "below_5_deg_percent"),
        (SCENARIOS[0], "asymmetric", "below_5_deg_percent"),
        (SCENARIOS[0], "all", "error_r_deg"),
        (SCENARIOS[0], "asymmetric", "error_r_deg"),
        (SCENARIOS[1], "all", "below_5_deg_percent"),
        (SCENARIOS[1], "all", "error_r_deg"),
    ]
    assert tables[0].title == (
        "Beyond the paper: Starts to success, below 5° (ModelNet40, partial overlap)"
    )
    assert tables[0].heads()[:2] == [("1 start", "%"), ("2 starts", "%")]
    assert tables[0].metrics == ("1", "2", "4", "8", "16", "64")
    assert [(line.method, line.aside) for line in tables[0].lines] == [
        ("gicp_multistart", ""),
        ("pcrdiffusion_cf", ""),
        ("pcrdiffusion_cb_moved", "four steps"),
        ("pcrdiffusion_cb_moved", "one step"),
    ]
    (moved,) = (line for line in tables[4].lines if line.aside == "one step")
    assert [*moved.cells] == ["1", "2", "4"]
    expected = pick(
        numbers, scenario="kitti", setting="one_step,starts=4", metric="below_5_deg_percent"
    )
    assert moved.cells["4"].value == expected["value"]


def test_both_documents_lay_the_tables_out_whole(numbers: pd.DataFrame) -> None:
    tables, sources = tables_of(numbers), weigh_sources(numbers)
    text = render_markdown(tables, None, sources=sources)
    assert "| Method | 1 start, % | 2 starts, % |" in text
    for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        assert len({line.count("|") for line in block.splitlines()}) == 1
    assert "\n- KITTI: PCRDiffusion CF: 1 sample finds " in text
    assert "\n\n\n" not in text
    labels = re.findall(r"\\label\{(.*?)\}", render_latex(tables, None))
    assert len({*labels}) == len(labels) == 6


def test_a_line_of_the_chart_is_a_source_by_starts_and_by_milliseconds(
    numbers: pd.DataFrame,
) -> None:
    figure = starts_chart(numbers, "kitti")
    drawn = {(trace.name, trace.xaxis): trace for trace in figure.data}
    assert len(drawn) == 2 * 4
    assert [*drawn["PCRDiffusion CB moved, one step", "x"].x] == [1, 2, 4]
    by_time = drawn["GICP, random starts", "x2"]
    assert [*by_time.x] == [1e3, 2e3, 3e3, 4e3, 5e3, 6e3]
    shares = choose(numbers, scenario="kitti", metric="below_5_deg_percent")
    shares = choose(shares, method="gicp_multistart").set_index("starts")["value"]
    assert [*by_time.y] == [shares[count] for count in ("1", "2", "4", "8", "16", "64")]
    assert by_time.error_y.array.max() > 0
    assert figure.layout.xaxis2.title.text == (
        "time for a pair [ms], measured on ModelNet40, partial overlap"
    )
    assert figure.layout.xaxis.type == "log"
    assert figure.layout.yaxis.title.text == "pairs below 5° [%]"


def test_without_times_the_chart_has_one_panel(tmp_path: Path) -> None:
    write_found(tmp_path, "kitti")
    figure = starts_chart(numbers_of(tmp_path), "kitti")
    assert {trace.xaxis for trace in figure.data} == {"x"}
    assert figure.layout.xaxis.title.text == "number of starts"


def test_times_that_name_no_scenario_stand_for_every_one(tmp_path: Path) -> None:
    write_found(tmp_path, "kitti", {"icp": FOUND["icp"]})
    row = {"method": "icp", "pair": 0, "setting": "starts=1", "seconds": "0.25"}
    write_rows(tmp_path / TIMES, [row | {"peak_memory_mib": "1"}])
    figure = starts_chart(numbers_of(tmp_path), "kitti")
    assert [*figure.data[1].x] == [250]
    assert figure.layout.xaxis2.title.text == "time for a pair [ms]"


def test_a_learned_source_is_worth_the_fewest_random_starts_that_find_no_fewer(
    tmp_path: Path,
) -> None:
    write_found(tmp_path, "kitti")
    (told,) = weigh_sources(numbers_of(tmp_path)).values()
    assert [re.sub(r" \[.*?\]", "", sentence) for sentence in told] == [
        "PCRDiffusion CF: 1 sample finds 20.0 % of the pairs, which takes 2 random starts (20.0 %);"
        " 4 samples find 60.0 % of the pairs, which takes 16 random starts (60.0 %).",
        "PCRDiffusion CB moved, four steps: 4 samples find 70.0 % of the pairs, which takes more than"
        " 16 random starts (60.0 %).",
    ]


@pytest.mark.parametrize("left_out", ["gicp_multistart", "learned"])
def test_without_random_or_learned_starts_nothing_is_weighed(tmp_path: Path, left_out: str) -> None:
    kept = ["icp", "pcrdiffusion_cf"] if left_out == "gicp_multistart" else ["gicp_multistart"]
    write_found(tmp_path, "kitti", {method: FOUND[method] for method in kept})
    found = numbers_of(tmp_path)
    assert weigh_sources(found) == {}
    assert len(tables_of(found)) == 2


def test_a_line_tells_of_the_weights_that_came_along_and_of_its_most_failures(
    tmp_path: Path,
) -> None:
    file = write_found(tmp_path, "kitti")
    lines = file.read_text().splitlines()
    failed = [line.replace('"paper,starts=4",', '"paper,starts=4",no match') for line in lines]
    file.write_text("\n".join(failed) + "\n")
    facts = {"epochs": 9, "data": {"source": "download"}}
    came = Training("kitti", "pcrdiffusion_cf", facts, pd.DataFrame(), (SHIPPED,))
    (table, _) = make_tables(numbers_of(tmp_path), [came], {"kitti": file_of("kitti")})
    failures = {line.method: line.failures for line in table.lines}
    assert failures == dict.fromkeys(FOUND, 0) | {"pcrdiffusion_cf": 10}
    (cf,) = (line for line in table.lines if line.method == "pcrdiffusion_cf")
    said = "weights that came with the code, from download data, 9 epochs"
    assert said in table.notes[cf.note - 1]

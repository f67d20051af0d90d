"""Findings: the rule of the verdicts, and what the page then says."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.reporting.background import read_pair_files
from pipeline.reporting.difficulty import measure_difficulties
from pipeline.reporting.findings import Finding, make_findings
from pipeline.reporting.paper import UNSEEN_OBJECTS
from pipeline.reporting.result_files import read_results, read_times
from pipeline.reporting.tables import Row, make_rows
from pipeline.reporting.weighing import above, below, said, weigh, weigh_same, weigh_some
from tests.pipeline.reporting.made_up_results import (
    EVERY_METHOD,
    SCENARIOS,
    plain_row,
    result_file,
    write_everything,
    write_rows,
)

CB = "pcrdiffusion_cb"


def contrast(low: float, high: float, setting: str = "paper minus fgr:paper") -> Row:
    value = (low + high) / 2
    return Row(
        "1a", UNSEEN_OBJECTS, "all", CB, setting, "error_r_deg", value, low, high, None, 9, 0
    )


SIDES = {"below": contrast(-2, -1), "above": contrast(1, 2), "across": contrast(-1, 1)}


@pytest.mark.parametrize(
    ("sides", "verdict"),
    [
        (["below"], "confirmed"),
        (["above"], "not confirmed"),
        (["across"], "undecided"),
        (["below", "below"], "confirmed"),
        (["below", "across"], "undecided"),
        (["below", "above"], "not confirmed"),
        (["below", "missing"], "not run"),
        (["above", "missing"], "not confirmed"),
        ([], "not run"),
    ],
)
def test_a_claim_over_all_needs_every_interval_on_its_side(
    sides: Sequence[str], verdict: str
) -> None:
    assert weigh([SIDES.get(side) for side in sides], below, above) == verdict


@pytest.mark.parametrize(
    ("sides", "verdict"),
    [
        (["above", "below"], "confirmed"),
        (["above", "across"], "undecided"),
        (["above", "above"], "not confirmed"),
        ([], "not run"),
    ],
)
def test_a_claim_of_somewhere_needs_one(sides: Sequence[str], verdict: str) -> None:
    assert weigh_some([SIDES[side] for side in sides], below, above) == verdict


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (-0.1, 0.2, "confirmed"),
        (-0.6, 0.2, "undecided"),
        (0.01, 0.02, "not confirmed"),  # small, yet a difference
        (-0.5, 0.5, "confirmed"),
    ],
)
def test_no_difference_needs_a_narrow_interval_around_zero(
    low: float, high: float, verdict: str
) -> None:
    assert weigh_same([contrast(low, high)]) == verdict


def test_a_number_is_said_with_unit_sign_and_interval() -> None:
    assert said(contrast(1, 2)) == "+1.50° [+1.00, +2.00]"
    assert said(contrast(-2, -1)) == "-1.50° [-2.00, -1.00]"
    assert said(contrast(1, 2, "paper")) == "1.50° [1.00, 2.00]"


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[Row]:
    """Rows of every method and ablation."""
    folder = tmp_path_factory.mktemp("made_up")
    write_everything(folder, SCENARIOS, 30, EVERY_METHOD)
    scores, times = read_results(folder / "results"), read_times(folder / "results")
    difficulties = measure_difficulties(read_pair_files(folder / "pairs", SCENARIOS))
    return make_rows(scores, times, difficulties, seed=0)


@pytest.fixture(scope="module")
def findings(rows: list[Row]) -> list[Finding]:
    return make_findings(rows)


def find(findings: Sequence[Finding], topic: str) -> Finding:
    (found,) = [finding for finding in findings if finding.topic == topic]
    return found


def test_every_claim_is_weighed_once_all_is_there(findings: Sequence[Finding]) -> None:
    assert len({finding.topic for finding in findings}) == len(findings) == 24
    assert [finding.topic for finding in findings if finding.verdict == "not run"] == []


def test_every_sentence_has_a_number_with_its_interval(findings: Sequence[Finding]) -> None:
    for finding in findings:
        assert finding.ours, finding.topic
        for sentence in finding.ours:
            assert re.search(r"\d [^\[]*\[-?\+?[\d.e+-]+, -?\+?[\d.e+-]+\]|\d°? \[", sentence), (
                sentence
            )


def test_every_number_of_a_sentence_is_one_of_the_rows(
    rows: list[Row], findings: Sequence[Finding]
) -> None:
    known = {said(row) for row in rows}
    told = [
        number
        for finding in findings
        if "random start" not in finding.topic  # its numbers are made of several rows
        for sentence in finding.ours
        for number in re.findall(r"[+-]?[\d.e-]+(?:°| %| s) \[[^\]]*\]", sentence)
    ]
    assert len(told) > 100
    assert {*told} <= known


@pytest.mark.parametrize(
    ("topic", "verdict"),
    [  # by how the made-up errors were drawn
        ("Order of methods: ModelNet40, unseen objects", "confirmed"),
        ("Order of correspondence-free methods: ModelNet40, unseen objects", "not confirmed"),
        ("Improvement: correspondence-free", "not confirmed"),
        ("Difficulty of the settings with full overlap", "not confirmed"),
        ("Fusion: concatenation", "not confirmed"),
        ("Speed: correspondence-free", "confirmed"),
    ],
)
def test_made_up_errors_are_judged_as_they_were_made(
    findings: Sequence[Finding], topic: str, verdict: str
) -> None:
    assert find(findings, topic).verdict == verdict


def test_nothing_is_claimed_of_what_was_not_run(tmp_path: Path) -> None:
    write_rows(result_file(tmp_path, "kitti", "identity"), [plain_row(0, off_deg=1.0)])
    found = make_findings(make_rows(read_results(tmp_path), seed=0))
    assert {finding.verdict for finding in found} == {"not run"}


def test_one_rival_ahead_refutes_an_order_though_others_are_missing(tmp_path: Path) -> None:
    write_rows(result_file(tmp_path, "kitti", CB), [plain_row(0, off_deg=1.0)])
    write_rows(result_file(tmp_path, "kitti", "fgr"), [plain_row(0, off_deg=0.5)])
    finding = find(
        make_findings(make_rows(read_results(tmp_path), seed=0)), "Order of methods: KITTI"
    )
    assert finding.verdict == "not confirmed"
    assert finding.ours[1] == (
        "It is behind 1 of 8 (its error minus theirs): FGR +1.00° [+1.00, +1.00]."
    )
    assert "7 were not run" in finding.ours[2]


def test_two_settings_that_learnt_nothing_are_not_weighed(rows: Sequence[Row]) -> None:
    def changed(kind: str, value: float, among: Sequence[Row]) -> list[Row]:
        return [
            replace(row, value=value, low=value - 1, high=value + 1)
            if (row.table, row.method, row.kind) == ("3", CB, kind)
            else row
            for row in among
        ]

    ahead = changed("contrast", -5.0, rows)
    before = find(make_findings(ahead), "Gain by diffusion: CB")
    assert before.verdict == "confirmed"
    after = find(make_findings(changed("line", 90.0, ahead)), "Gain by diffusion: CB")
    assert after.verdict == "undecided"
    assert after.ours[-1].startswith("Neither is below the constant pose, ")

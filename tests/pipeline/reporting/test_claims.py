"""Findings: the rule of the verdicts, and what the page then says."""

import re
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pytest

from pipeline.reporting.claims import Finding, make_findings
from pipeline.reporting.difficulty import measure_difficulty
from pipeline.reporting.numbers import make_numbers, spread_over_draws
from pipeline.reporting.paper import UNSEEN_OBJECTS
from pipeline.reporting.reading import read_answers, read_pair_files, read_times
from pipeline.reporting.verdicts import (
    Number,
    Numbers,
    above,
    below,
    said,
    weigh,
    weigh_same,
    weigh_some,
)
from tests.pipeline.reporting.synthetic_results import (
    EVERY_METHOD,
    SCENARIOS,
    plain_row,
    result_file,
    write_everything,
    write_rows,
)
from tests.pipeline.reporting.test_numbers import numbers_of

CB = "pcrdiffusion_cb"


def contrast(low: float, high: float, base: tuple[str, str] = ("fgr", "paper")) -> Number:
    place = ("1a", UNSEEN_OBJECTS, CB, "paper", *base, "error_r_deg")
    return Number(*place, (low + high) / 2, low, high, False)


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
    assert said(contrast(1, 2, ("", ""))) == "1.50° [1.00, 2.00]"
    assert said(contrast(-4e-8, 3)) == "+1.50° [< 1e-6, +3.00]"


@pytest.fixture(scope="module")
def numbers(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    """Numbers of every method and ablation, spreads among them."""
    folder = tmp_path_factory.mktemp("synthetic")
    write_everything(folder, SCENARIOS, 30, EVERY_METHOD)
    answers, times = read_answers(folder / "results"), read_times(folder / "results")
    difficulty = measure_difficulty(read_pair_files(folder / "pairs", SCENARIOS))
    made = make_numbers(answers, times, difficulty, seed=0)
    return pd.concat([made, spread_over_draws(made)], ignore_index=True)


@pytest.fixture(scope="module")
def findings(numbers: pd.DataFrame) -> list[Finding]:
    return make_findings(numbers)


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
    numbers: pd.DataFrame, findings: Sequence[Finding]
) -> None:
    rows = numbers[[*Number._fields]].itertuples(index=False, name=None)
    known = {said(Number(*row)) for row in rows}
    told = [
        number
        for finding in findings
        for sentence in finding.ours
        for number in re.findall(r"[+-]?[\d.e-]+(?:°| %| s) \[[^\]]*\]", sentence)
    ]
    assert len(told) > 100
    assert {*told} <= known


@pytest.mark.parametrize(
    ("topic", "verdict"),
    [  # by how the synthetic errors were drawn
        ("Order of methods: ModelNet40, unseen objects", "confirmed"),
        ("Order of correspondence-free methods: ModelNet40, unseen objects", "not confirmed"),
        ("Improvement: correspondence-free", "not confirmed"),
        ("Difficulty of the settings with full overlap", "not confirmed"),
        ("Fusion: concatenation", "not confirmed"),
        ("Speed: correspondence-free", "confirmed"),
    ],
)
def test_synthetic_errors_are_judged_as_they_were_made(
    findings: Sequence[Finding], topic: str, verdict: str
) -> None:
    assert find(findings, topic).verdict == verdict


def test_nothing_is_claimed_of_what_was_not_run(tmp_path: Path) -> None:
    write_rows(result_file(tmp_path, "kitti", "identity"), [plain_row(0, off_deg=1.0)])
    found = make_findings(numbers_of(tmp_path))
    assert {finding.verdict for finding in found} == {"not run"}


def test_one_rival_ahead_refutes_an_order_though_others_are_missing(tmp_path: Path) -> None:
    write_rows(result_file(tmp_path, "kitti", CB), [plain_row(0, off_deg=1.0)])
    write_rows(result_file(tmp_path, "kitti", "fgr"), [plain_row(0, off_deg=0.5)])
    finding = find(make_findings(numbers_of(tmp_path)), "Order of methods: KITTI")
    assert finding.verdict == "not confirmed"
    assert finding.ours[1] == (
        "It is behind 1 of 8 (its error minus theirs): FGR +1.00° [+1.00, +1.00]."
    )
    assert "7 were not run" in finding.ours[2]


def test_two_settings_that_learnt_nothing_are_not_weighed(numbers: pd.DataFrame) -> None:
    def changed(kind: str, value: float, among: pd.DataFrame) -> pd.DataFrame:
        at = (among["table"] == "3") & (among["method"] == CB) & (among["kind"] == kind)
        among = among.copy()
        among.loc[at, ["value", "low", "high"]] = [value, value - 1, value + 1]
        return among

    ahead = changed("contrast", -5.0, numbers)
    before = find(make_findings(ahead), "Gain by diffusion: CB")
    assert before.verdict == "confirmed"
    after = find(make_findings(changed("line", 90.0, ahead)), "Gain by diffusion: CB")
    assert after.verdict == "undecided"
    assert after.ours[-1].startswith("Neither is below the constant pose, ")


def test_numbers_are_found_by_where_they_stand(numbers: pd.DataFrame) -> None:
    found = Numbers(numbers)
    main = found.main(UNSEEN_OBJECTS, CB)
    assert main == found.at("1a", UNSEEN_OBJECTS, CB, "paper")
    versus = found.versus(UNSEEN_OBJECTS, CB, "fgr")
    assert versus
    assert (versus.base_method, versus.base_setting) == ("fgr", "paper")
    assert found.versus(UNSEEN_OBJECTS, CB, "nobody") is None
    assert found.settings("noise", CB) == [f"noise={sd}" for sd in (0.0, 0.005, 0.01, 0.02, 0.04)]
    assert len(found.settings("steps", CB)) == 10  # no further draws
    assert found.ablated("steps", CB, "steps=3,sampler=ddpm") is None
    assert {*found.methods(UNSEEN_OBJECTS)} == {*EVERY_METHOD}

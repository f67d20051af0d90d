"""What a stage needs comes before it, and what most need comes first."""

from pipeline.command.graph import by_urgency, leading_to, wanted

NEEDS: dict[str, set[str]] = {
    "data": set(),
    "train@a": {"data"},
    "train@b": {"data"},
    "ask@a": {"train@a"},
    "ask@b": {"train@b"},
    "compare": {"train@a", "train@b"},
    "report": {"ask@a", "ask@b", "compare"},
}


def test_what_others_wait_for_goes_first_and_small_ends_last() -> None:
    order = by_urgency(NEEDS)
    assert order[0] == "data"
    assert set(order[1:3]) == {"train@a", "train@b"}
    assert order[3] == "compare"
    assert order[-1] == "report"


def test_a_stage_or_a_group_is_wanted_with_all_it_needs() -> None:
    assert set(wanted(NEEDS, ["ask@a"])) == {"data", "train@a", "ask@a"}
    assert set(wanted(NEEDS, ["train", "ask@b"])) == {"data", "train@a", "train@b", "ask@b"}
    assert wanted(NEEDS, []) == NEEDS
    assert leading_to([], NEEDS) == {}

"""The largest of each row."""

import torch

from pcrdiff.geometry.argmax import row_argmax
from tests.pcrdiff.made_up_clouds import seeded


def test_the_largest_of_each_row_is_found() -> None:
    scores = torch.randn(50, 301, generator=seeded(0))
    assert torch.equal(row_argmax(scores), scores.argmax(dim=-1))


def test_of_equals_it_is_the_first() -> None:
    assert row_argmax(torch.tensor([[1.0, 3.0, 3.0], [2.0, 2.0, 2.0]])).tolist() == [1, 0]


def test_rows_need_not_lie_along_memory() -> None:
    scores = torch.randn(7, 5, generator=seeded(1)).mT
    assert torch.equal(row_argmax(scores), scores.argmax(dim=-1))

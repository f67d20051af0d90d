"""Precision of a search: what is asked for decides, on any processor."""

import pytest
import torch

from pcrdiff.geometry.precision import (
    multiplies_in_bfloat16,
    resolve,
    search_precision,
    search_scores,
    set_search_precision,
)
from tests.pcrdiff.synthetic_clouds import seeded


def factors(dtype: torch.dtype = torch.float32) -> tuple[torch.Tensor, torch.Tensor]:
    generator = seeded(0)
    weight, hidden = (torch.randn(n, 64, generator=generator, dtype=dtype) for n in (32, 50))
    return weight, hidden


def test_the_library_searches_in_float32_unless_told_otherwise() -> None:
    assert search_precision() == "float32"


def test_auto_is_what_the_processor_multiplies_in(processor: str) -> None:
    assert multiplies_in_bfloat16() == (processor == "with bfloat16")
    assert resolve("auto") == ("bfloat16" if processor == "with bfloat16" else "float32")


@pytest.mark.parametrize("name", ["amx_bf16", "avx512_bf16"])
def test_either_instruction_set_will_do(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {name: True})
    assert resolve("auto") == "bfloat16"


def test_a_processor_of_which_nothing_is_known_searches_in_float32(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(torch.cpu, "get_capabilities", dict)
    assert resolve("auto") == "float32"


@pytest.mark.usefixtures("processor")
def test_what_is_asked_for_by_name_is_what_is_meant() -> None:
    assert resolve("float32") == "float32"
    assert resolve("bfloat16") == "bfloat16"


@pytest.mark.usefixtures("processor")
def test_in_float32_scores_are_the_product() -> None:
    weight, hidden = factors()
    assert torch.equal(search_scores(weight, hidden), weight @ hidden.mT)


@pytest.mark.usefixtures("processor")
def test_in_bfloat16_scores_are_products_of_rounded_factors_summed_in_float32() -> None:
    weight, hidden = factors()
    set_search_precision("bfloat16")
    wanted = weight.bfloat16().double() @ hidden.bfloat16().double().mT
    rounding = (wanted - weight.double() @ hidden.double().mT).abs().max()
    assert (search_scores(weight, hidden) - wanted).abs().max() < 1e-3 * rounding


@pytest.mark.usefixtures("processor")
def test_doubles_are_not_rounded() -> None:
    weight, hidden = factors(torch.float64)
    set_search_precision("bfloat16")
    assert torch.equal(search_scores(weight, hidden), weight @ hidden.mT)


@pytest.mark.usefixtures("processor")
def test_products_of_others_keep_their_precision() -> None:
    weight, hidden = factors()
    before = weight @ hidden.mT
    set_search_precision("bfloat16")
    search_scores(weight, hidden)
    assert torch.equal(weight @ hidden.mT, before)

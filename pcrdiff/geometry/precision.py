"""The precision in which maxima are searched: a setting of the process."""

from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

SearchPrecision = Literal["float32", "bfloat16"]
Asked = SearchPrecision | Literal["auto"]
_setting: list[SearchPrecision] = ["float32"]


def multiplies_in_bfloat16() -> bool:
    """Whether this processor has products of bfloat16; others only round the factors."""
    found = torch.cpu.get_capabilities()
    return any(found.get(name) for name in ("amx_bf16", "avx512_bf16"))


def resolve(asked: Asked) -> SearchPrecision:
    """``auto`` is bfloat16 where the processor multiplies in it, else float32."""
    if asked != "auto":
        return asked
    return "bfloat16" if multiplies_in_bfloat16() else "float32"


def search_precision() -> SearchPrecision:
    """The precision in which this process searches for maxima."""
    return _setting[0]


def set_search_precision(precision: SearchPrecision) -> None:
    """Search for maxima in ``precision`` from here on, in all threads of this process.

    In float32 the maximum itself is found. In bfloat16 another point may be taken where two agree
    in their first two or three digits.

    Raises:
        ValueError: It is neither float32 nor bfloat16.
    """
    if precision not in ("float32", "bfloat16"):
        raise ValueError(f"search_precision needs float32 or bfloat16, got {precision!r}")
    _setting[0] = precision


def search_scores(
    weight: Float[Tensor, "dim width"], hidden: Float[Tensor, "n width"]
) -> Float[Tensor, "dim n"]:
    """``W H^T``, what a search for maxima compares, in the precision that is set.

    In bfloat16 the factors are rounded and their products summed in float32, on every processor;
    torch uses bfloat16 products where the processor has them. Doubles are never rounded.
    """
    if search_precision() == "float32" or weight.dtype != torch.float32:
        return weight @ hidden.mT
    rounded, rows = weight.bfloat16().float(), hidden.bfloat16().float()
    if not multiplies_in_bfloat16():
        return rounded @ rows.mT
    products = torch.backends.mkldnn.matmul  # type: ignore[attr-defined]  # made at run time
    before = products.fp32_precision
    products.fp32_precision = "bf16"
    try:
        return rounded @ rows.mT
    finally:
        products.fp32_precision = before

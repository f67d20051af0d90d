"""Words that stand where a finite number should, as programs really write them."""

NO_NUMBERS = (
    "nan", "-nan", "inf", "-Infinity", "1e999", "1.#QNAN", "1.#INF", "-1.#IND", "-nan(ind)",
    "0.5#", "0x1p-1", "1_000", "0.5D+00", "٣", "--1", "None",
)  # fmt: skip

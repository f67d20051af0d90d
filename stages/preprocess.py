"""DVC stage ``preprocess``: a raw data set to the pair file of one scenario."""

import argparse
from pathlib import Path

from pipeline.artifacts import write_pairs
from pipeline.machine import settle
from pipeline.params import pick, read_params
from pipeline.preprocessing import preprocess
from pipeline.spreading import spread_over
from pipeline.stage import run
from pipeline.tracking import journal


def main(argv: list[str] | None = None) -> None:
    """Read params and the raw items, make the pairs of each split, write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--raw", type=Path, required=True)
    parser.add_argument("--pairs", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    section = pick(params.scenarios, args.scenario, "scenarios")
    family = params.acquire[section.dataset].family
    settle(threads=1)  # a pair has no work for more
    told = {"scenario": args.scenario, "dataset": section.dataset, "num_points": section.num_points}
    with journal(params=told, inputs=[args.raw]) as notes:
        spread = spread_over(params.compute, threads=1)
        made = preprocess(args.scenario, section, family, args.raw, seed=params.seed, spread=spread)
        write_pairs(args.pairs, made.splits, made.label, made.attributes)
        pairs = {f"{name}_pairs": split.count for name, split in made.splits.items()}
        dropped = {f"{name}_dropped": len(shapes) for name, shapes in made.dropped.items()}
        notes.metrics(pairs | dropped)


if __name__ == "__main__":
    run(main)

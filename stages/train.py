"""DVC stage ``train``: the pairs of a scenario to the weights of one learned method, or a variant."""

import argparse
from pathlib import Path

from pipeline.artifacts import write_curve, write_json, write_weights
from pipeline.checkpoints import open_checkpoint
from pipeline.machine import settle
from pipeline.params import read_params
from pipeline.stage import run
from pipeline.tracking import journal
from pipeline.training import CODE, train_method, training_params
from pipeline.variants import AS_IT_IS, parse_variant


def main(argv: list[str] | None = None) -> None:
    """Read params and pairs, train, write the best weights, the curve and what it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--method", required=True)
    parser.add_argument("--variant", type=parse_variant, default=AS_IT_IS, help="of its network")
    for name in ("pairs", "weights", "curve", "facts"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads)
    told = training_params(params, args.scenario, args.method, args.variant)
    with (
        journal(params=told, inputs=[args.pairs]) as notes,
        open_checkpoint(told, [args.pairs, *CODE]) as checkpoint,
    ):
        trained = train_method(
            params, args.scenario, args.method, args.variant, args.pairs, checkpoint
        )
        write_weights(args.weights, trained.weights, trained.facts)
        write_curve(args.curve, trained.curve)
        write_json(args.facts, trained.facts)
        trained.note(notes)


if __name__ == "__main__":
    run(main)

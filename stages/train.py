"""DVC stage ``train``: the pairs of a scenario to the weights of one learned method, or a variant."""

import argparse
from functools import partial
from pathlib import Path

from pipeline.artifacts import write_curve, write_json, write_weights
from pipeline.checkpoints import NoCheckpoint, open_checkpoint
from pipeline.machine import settle
from pipeline.params import read_params
from pipeline.processes import check_agreement, join
from pipeline.stage import run
from pipeline.tracking import journal
from pipeline.training import CODE, train_method, training_params
from pipeline.variants import AS_IT_IS, parse_variant


def main(argv: list[str] | None = None) -> None:
    """Read params and pairs, train, write the best weights, the curve and what it took.

    Of several processes the first writes; the others train along.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--method", required=True)
    parser.add_argument("--variant", type=parse_variant, default=AS_IT_IS, help="of its network")
    for name in ("pairs", "weights", "curve", "facts"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    told = training_params(params, args.scenario, args.method, args.variant)
    made_of = [args.pairs, *CODE]
    trained = partial(train_method, params, args.scenario, args.method, args.variant, args.pairs)
    with join(params.train.devices, params.train.nodes) as processes:
        settle(params.threads, params.search_precision)
        check_agreement(processes, told, made_of)
        if processes.rank > 0:
            trained(NoCheckpoint(), processes)
            return
        with (
            journal(params=told, inputs=[args.pairs]) as notes,
            open_checkpoint(told, made_of) as checkpoint,
        ):
            outcome = trained(checkpoint, processes)
            write_weights(args.weights, outcome.weights, outcome.facts)
            write_curve(args.curve, outcome.curve)
            write_json(args.facts, outcome.facts)
            outcome.note(notes)


if __name__ == "__main__":
    run(main)

"""DVC stage ``ablate_starts``: how many starts find the pose, by where they come from.

Beyond the paper. Every source proposes its starts once for a pair; the answer under each count is
the best fit among the first so many of them.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path

import torch

from pcrdiff.evaluation import Estimates
from pcrdiff.geometry.precision import search_precision
from pcrdiff.hypotheses import Search, Starts, Verified, VerifiedMethod
from pcrdiff.registration import Pairs, Source, Target
from pipeline.answering import answer_all
from pipeline.compute.machine import settle
from pipeline.formats.answers import write_ablation
from pipeline.formats.pairs import read_pairs
from pipeline.loading import load_sources, named_count
from pipeline.settings.params import Params, read_params
from pipeline.tracking.journal import journal


def main(argv: list[str] | None = None) -> None:
    """Read params, pairs and shipped weights, register under each count, write a row for each pair."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--pairs", type=Path, required=True)
    parser.add_argument("--weights", type=Path, required=True, help="folder of shipped weights")
    parser.add_argument("--answers", type=Path, required=True)
    args = parser.parse_args(argv)

    params = read_params()
    settle(params.threads, params.search_precision)
    shown = {"search_precision": search_precision(), "scenario": args.scenario}
    with journal(params=shown, inputs=[args.pairs]) as notes:
        test = some_of(read_pairs(args.pairs, "test"), params.ablation.starts.pairs)
        answers = {
            name: answer_counts(
                params, load_sources(params, name, args.scenario, args.pairs, args.weights), test
            )
            for name in params.ablation.starts.sources
        }
        write_ablation(args.answers, test, answers)
        notes.artifact(args.answers)


def some_of(pairs: Pairs, most: int) -> Pairs:
    """At most so many of the pairs, evenly along their order."""
    count = min(most, len(pairs))
    return pairs.select(torch.linspace(0, len(pairs) - 1, count).round().long())


def answer_counts(
    params: Params, settings: Mapping[str, VerifiedMethod], test: Pairs
) -> Mapping[str, Estimates]:
    """The answers of a source, in each of its settings under each count of its starts."""
    counts = params.ablation.starts.counts
    shared = {setting: SearchOnce(source, max(counts)) for setting, source in settings.items()}
    drawn = {
        named_count(setting, count): (FirstStarts(search, count), 0)
        for setting, search in shared.items()
        for count in counts
    }
    return answer_all(params, drawn, test)


class SearchOnce:
    """A source that keeps the starts of the last pair, refined, for several counts."""

    def __init__(self, source: VerifiedMethod, most: int) -> None:
        self.source, self.most = source, most
        self._last: tuple[Source, Target, Search] | None = None

    def search(self, source: Source, target: Target, *, generator: torch.Generator) -> Search:
        """The starts of a pair; of the same two clouds only once."""
        clouds = source.data_ptr(), target.data_ptr()  # the clouds are kept, so no others lie there
        if self._last is None or clouds != tuple(cloud.data_ptr() for cloud in self._last[:2]):
            starts = self.source.propose(source, target, self.most, generator=generator)
            self._last = source, target, Search(starts, source, target, self.source.refinement)
        return self._last[2]


class FirstStarts(VerifiedMethod):
    """The first few starts of a source."""

    def __init__(self, shared: SearchOnce, count: int) -> None:
        source = shared.source
        self.name, self.least_points, self.normals = (
            source.name,
            source.least_points,
            source.normals,
        )
        self.shared, self.starts, self.refinement = shared, count, source.refinement

    def propose(
        self, source: Source, target: Target, count: int, *, generator: torch.Generator
    ) -> Starts:
        """What the source proposes."""
        return self.shared.source.propose(source, target, count, generator=generator)

    def judge(self, source: Source, target: Target, *, generator: torch.Generator) -> Verified:
        """The best fit among the first few."""
        found = self.shared.search(source, target, generator=generator)
        return found.judge(self.name, self.starts)

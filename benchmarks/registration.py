"""(ii) Registering the same pairs by every method of the table, one by one and in bulk."""

import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import torch
from jaxtyping import Float
from torch import Tensor

from benchmarks.effort import Effort
from benchmarks.inputs import make_pairs, shipped_weights, trained_methods, weights_of
from benchmarks.measuring import Comparison, summarise, time_of
from pcrdiff.geometry.metrics import error_r_deg, error_t
from pcrdiff.registration import LearnedMethod, Method, Pairs
from pipeline.compute.progress import bar
from pipeline.formats.benchmarks import Latency
from pipeline.formats.weights import shipped_setting
from pipeline.loading import build_classical, load_learned, load_shipped, settings_of
from pipeline.settings.params import Params

CF, CB, RPMNET, ICP = "pcrdiffusion_cf", "pcrdiffusion_cb", "rpmnet", "icp_centroid"
MULTISTART, RANSAC = "gicp_multistart", "ransac_fpfh"
BLIND = ("identity", "constant")
"""Methods that do not look at the clouds; nobody's peers."""


@dataclass(eq=False)
class Contender:
    """A method in one setting, and what it took."""

    method: Method
    setting: str
    test: Pairs
    """All pairs, each cloud cut to what the method is given of it."""
    share: int = 0
    """How many pairs it registers in a round."""
    ms: dict[int, list[float]] = field(default_factory=dict)
    """Seconds of each pair on its own, once per round that it is in."""
    rates: list[float] = field(default_factory=list)
    """Pairs a second in bulk, by round."""
    answers: dict[int, Tensor | None] = field(default_factory=dict)
    """The pose of each pair, nothing where the method failed."""

    @property
    def points(self) -> int:
        """Points of each cloud."""
        return self.test.source.shape[1]

    @property
    def pair_ms(self) -> dict[int, float]:
        """Seconds of each pair on its own, median over its rounds."""
        return {k: summarise(each).median for k, each in self.ms.items()}

    @property
    def latency(self) -> float:
        """Median over pairs, in ms."""
        return summarise([*self.pair_ms.values()]).median

    @property
    def takes_many(self) -> bool:
        """Whether a batch is more to it than a loop over pairs."""
        return isinstance(self.method, LearnedMethod)

    def plan(self, effort: Effort) -> None:
        """Warm up, and see how many pairs fit into the time of a round."""
        self.register(0, 1)
        fit = int(effort.seconds / time_of(lambda: self.register(0, 1)))
        self.share = min(len(self.test), max(effort.least, fit))

    def run(self, turn: int) -> None:
        """One round: every pair on its own, then all at once where the method takes batches.

        A method that has no time for all pairs has others in each round.
        """
        first = turn * self.share % len(self.test)
        last = min(first + self.share, len(self.test))
        start = time.perf_counter()
        for k in range(first, last):
            before = time.perf_counter()
            self.answers[k] = self.register(k, k + 1)
            self.ms.setdefault(k, []).append(1e3 * (time.perf_counter() - before))
        if self.takes_many:
            start = time.perf_counter()
            poses = self.register(first, last)
        self.rates.append((last - first) / (time.perf_counter() - start))
        if self.takes_many and poses is not None:
            self.answers |= dict(zip(range(first, last), poses.unsqueeze(1), strict=True))

    def register(self, first: int, last: int) -> Float[Tensor, "pairs 4 4"] | None:
        """Answer these pairs at once; nothing where the method fails on one."""
        source, target = self.test.clouds(self.method.normals)
        generator = torch.Generator().manual_seed(first)
        try:
            return self.method.register(source[first:last], target[first:last], generator=generator)
        except (ValueError, RuntimeError):
            return None

    def row(self, environment: str) -> Latency:
        """What it took, beside how far off it was."""
        taken, nothing = summarise([*self.pair_ms.values()]), torch.eye(4).unsqueeze(0)
        poses = torch.cat([(nothing if T is None else T).double() for T in self.answers.values()])
        truth = self.test.T_target_source[[*self.answers]]
        return Latency(
            method=self.method.name,
            setting=self.setting,
            points=self.points,
            latency_ms=taken.median,
            spread_ms=taken.spread,
            n=taken.n,
            pairs_per_s=summarise(self.rates).median,
            batch=self.share,
            error_r_deg=error_r_deg(poses, truth).mean().item(),
            error_t=error_t(poses, truth).mean().item(),
            failures=sum(T is None for T in self.answers.values()),
            environment=environment,
        )


def measure_registration(params: Params, effort: Effort) -> list[Contender]:
    """Run every method in turn, ``effort.rounds`` times, so that all see one machine."""
    contenders = list(contend(params, effort))
    for contender in bar(contenders, "registration, warming up"):
        contender.plan(effort)
    turns = [(turn, each) for turn in range(effort.rounds) for each in contenders]
    for turn, contender in bar(turns, "registration"):
        contender.run(turn)
    return contenders


def contend(params: Params, effort: Effort) -> Iterable[Contender]:
    """Every method of the scenario's table in every setting, and CF on a part of the points.

    Beside them networks that came with the code, for the starts that are refined.
    """
    pairs = make_pairs(params, effort.points, effort.pairs)
    test = pairs["test"]
    for name in params.run.classical:
        methods = build_classical(name, params.methods, lambda: pairs["train"])
        for setting, method in methods.items():
            yield Contender(method, setting, test)
    for name in trained_methods(params):
        for setting in settings_of(name, params.methods):
            weights = weights_of(name)
            learned = load_learned(name, setting, params.methods, params.diffusion, weights)
            yield Contender(learned, setting, test)
            if name == CF:
                yield Contender(learned, setting, first_points(test, effort.subset))
    for weights in shipped_weights(params):
        for setting, method in load_shipped(params, weights.parent.name, weights).items():
            yield Contender(method, shipped_setting(setting), test)


def first_points(pairs: Pairs, count: int) -> Pairs:
    """The first points of each cloud: clouds are shuffled, so a random part of it."""
    source, target = pairs.source[:, :count], pairs.target[:, :count]
    return Pairs(source, target, pairs.T_target_source, pairs.item, pairs.group)


def compare_registrations(contenders: Sequence[Contender]) -> list[Comparison]:
    """The ratios that are claimed, where both sides were run."""
    whole = max(each.points for each in contenders)
    full = [each for each in contenders if each.points == whole]
    peers = sorted(
        (c for c in full if not c.takes_many and c.method.name not in BLIND),
        key=lambda each: each.latency,
    )
    cf, cb, rpmnet, icp = (_slowest(full, name) for name in (CF, CB, RPMNET, ICP))
    part = _slowest([each for each in contenders if each.points < whole], CF)
    found = []
    if cf and peers:
        found.append(_latencies("cf_latency_vs_fastest_peer", cf, peers[0]))
        for peer in peers:
            name = f"cf_latency_vs_{peer.method.name}_{peer.setting}"
            found.append(_latencies(name, cf, peer))
    if part and peers:
        name = f"cf_first_{part.points}_points_latency_vs_fastest_peer"
        found.append(_latencies(name, part, peers[0]))
    if cf and icp:
        name, unit = "cf_throughput_vs_icp", "pairs/s"
        found.append(Comparison(name, cf.rates, icp.rates, unit, higher_is_better=True))
    starts, ransac = _slowest(full, MULTISTART), _slowest(full, RANSAC)
    if starts and ransac:
        found.append(_latencies("refined_starts_latency_vs_ransac", starts, ransac))
    if cb and rpmnet:
        found.append(_latencies("cb_latency_vs_rpmnet", cb, rpmnet))
    return found


def _slowest(contenders: Sequence[Contender], name: str) -> Contender | None:
    """A method in the setting with the most updates: its authors' own, where it has several."""
    return max(
        (each for each in contenders if each.method.name == name),
        key=lambda each: each.latency,
        default=None,
    )


def _latencies(name: str, ours: Contender, peer: Contender) -> Comparison:
    """The ratios over the pairs that both registered."""
    mine, theirs = ours.pair_ms, peer.pair_ms
    common = sorted(mine.keys() & theirs.keys())
    if not common:
        raise ValueError(f"{name} needs pairs that both registered, got {len(mine)} and {len(theirs)} others")  # fmt: skip
    both = [[taken[k] for k in common] for taken in (mine, theirs)]
    return Comparison(name, both[0], both[1], "ms", higher_is_better=False)

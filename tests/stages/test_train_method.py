"""A training is what params.yaml says, and nothing else of it."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import Tensor

from pcrdiff.geometry.precision import SearchPrecision, set_search_precision
from pcrdiff.geometry.random_pose import PoseRange
from pipeline.command.ship import ship as ship_weights
from pipeline.formats.weights import read_weights, write_weights
from pipeline.settings.params import Params, TrainingParams, read_params
from pipeline.settings.variants import AS_IT_IS, Variant
from pipeline.tracking.journal import Journal, content_md5
from stages.train import CODE, Trained, Training, fresh_poses, train_method, training_params
from tests.described import read_templates
from tests.tiny import (
    CB,
    CF,
    PAIRS,
    SCENARIO,
    instance,
    refusal,
    tiny_params,
    write_params,
)

UNSEEN_CF = Training(SCENARIO, CF, PAIRS, Path("nowhere"))


class Forgetful:
    """A checkpoint that keeps nothing."""

    def load(self) -> None:
        """There is never anything."""

    def due(self) -> bool:
        """It is never time."""
        return False

    def save(self, tensors: object, record: object) -> None:
        """Nobody calls this."""
        raise AssertionError(f"saved {tensors}, {record}")


def train(params: Params, method: str = CF, variant: Variant = AS_IT_IS) -> Trained:
    training = Training(SCENARIO, method, PAIRS, Path("nowhere"), variant)
    return train_method(params, training, Forgetful())


def changed(params: Params, section: str, **update: object) -> Params:
    return params.model_copy(update={section: getattr(params, section).model_copy(update=update)})


def same(a: dict[str, Tensor], b: dict[str, Tensor]) -> bool:
    return a.keys() == b.keys() and all(torch.equal(a[name], b[name]) for name in a)


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("method", [CF, CB])
def test_the_facts_tell_how_much_training_it_was(method: str) -> None:
    trained = train(read_params(), method)
    facts = trained.facts
    assert (facts["method"], facts["scenario"]) == (method, SCENARIO)
    assert (facts["epochs"], facts["batch_size"], facts["train_pairs"]) == (3, 4, 6)
    assert facts["steps"] == 3 * 2  # six pairs in batches of four
    assert facts["parameters"] == sum(
        value.numel() for name, value in trained.weights.items() if not is_buffer(name, method)
    )
    validated = {epoch.epoch: epoch.val_error_r_deg for epoch in trained.curve}
    assert facts["val_error_r_deg"] == min(validated.values(), key=float)  # type: ignore[arg-type]
    assert validated[facts["best_epoch"]] == facts["val_error_r_deg"]  # type: ignore[index]


def is_buffer(name: str, method: str) -> bool:
    from pipeline.loading import build_untrained

    params = read_params()
    buffers = build_untrained(method, params.methods, params.diffusion).named_buffers()
    return name in dict(buffers)


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("update", [{"steps": 5}, {"steps": 5, "sampler": "ddim"}])
def test_how_evaluation_samples_does_not_reach_the_weights(update: dict[str, object]) -> None:
    params = read_params()
    plain, other = train(params), train(changed(params, "diffusion", **update))
    assert same(plain.weights, other.weights)
    assert plain.curve == other.curve
    assert plain.facts == other.facts


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("update", [{"timesteps": 21}])
def test_the_noise_reaches_the_weights(update: dict[str, object]) -> None:
    params = read_params()
    assert not same(train(params).weights, train(changed(params, "diffusion", **update)).weights)


@pytest.mark.usefixtures("project")
def test_the_seed_and_the_poses_reach_the_weights() -> None:
    params = read_params()
    plain = train(params).weights
    assert not same(plain, train(params.model_copy(update={"seed": 8})).weights)
    assert not same(plain, train(changed(params, "train", poses="fixed")).weights)


@pytest.mark.usefixtures("project")
def test_fresh_poses_stay_within_what_the_pair_file_says() -> None:
    made = read_params().scenarios[SCENARIO]
    told = PoseRange(made.max_rotation, made.max_translation, made.min_translation)
    assert fresh_poses(PAIRS) == told


@pytest.mark.usefixtures("project")
def test_auto_is_told_as_what_it_comes_to(processor: str) -> None:
    """So a checkpoint is not gone on with on another processor, and processes have to agree."""
    params = read_params().model_copy(update={"search_precision": "auto"})
    wanted = "bfloat16" if processor == "with bfloat16" else "float32"
    assert training_params(params, UNSEEN_CF)["search_precision"] == wanted


@pytest.mark.usefixtures("project")
@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_the_facts_tell_the_precision_of_the_search(precision: SearchPrecision) -> None:
    set_search_precision(precision)
    assert train(read_params()).facts["search_precision"] == precision


@pytest.mark.usefixtures("project")
def test_a_checkpoint_is_told_every_param_that_dvc_watches() -> None:
    """Or a training would go on from the checkpoint of another one."""
    params = read_params()
    told = training_params(params, UNSEEN_CF)
    wider = params.methods.pcrdiffusion_cf.network.model_copy(update={"feature_dim": 32})
    others = {
        "seed": params.model_copy(update={"seed": 8}),
        "threads": params.model_copy(update={"threads": 2}),
        "search_precision": params.model_copy(update={"search_precision": "bfloat16"}),
        "diffusion.timesteps": changed(params, "diffusion", timesteps=21),
        "train.devices": changed(params, "train", devices=2),
        "train.nodes": changed(params, "train", nodes=2),
        "train.poses": changed(params, "train", poses="fixed"),
        "train.${item.method}": changed(
            params, "train", **{CF: getattr(params.train, CF).model_copy(update={"patience": 9})}
        ),
        "methods.${item.method}.network": changed(
            params,
            "methods",
            **{CF: params.methods.pcrdiffusion_cf.model_copy(update={"network": wider})},
        ),
        "trainings.${item.method}.${item.scenario}": params.model_copy(
            update={"trainings": {CF: {SCENARIO: TrainingParams(epochs=4)}}}
        ),
    }
    assert others.keys() == set(read_templates()["train"]["params"])
    unseen = [key for key, other in others.items() if training_params(other, UNSEEN_CF) == told]
    assert unseen == []


def test_a_checkpoint_is_told_all_code_that_a_training_runs() -> None:
    deps = [Path(dep) for dep in read_templates()["train"]["deps"] if "${" not in dep]
    assert [d for d in deps if not any(d.is_relative_to(code) for code in CODE)] == []


@pytest.mark.usefixtures("project")
def test_the_journal_gets_the_curve(tmp_path: Path) -> None:
    trained = train(read_params())
    notes = Journal(tmp_path / "journal")
    trained.note_curve(notes)
    notes.close("FINISHED")
    text = (tmp_path / "journal" / "journal.jsonl").read_text()
    for name in ("loss", "val_error_r_deg"):
        assert f'"{name}"' in text
    assert '"step": 2' in text


@pytest.mark.usefixtures("project")
def test_refuses_a_missing_pair_file() -> None:
    with pytest.raises(FileNotFoundError, match=r"gone\.h5, there is none: run preprocess"):
        train_method(read_params(), replace(UNSEEN_CF, pairs=Path("gone.h5")), Forgetful())


def ship(own: Path, **network: int) -> Path:
    """Ship what the project has trained, and have its params start from that, in another network."""
    Path("pcrdiff").unlink()
    shipped, _ = ship_weights(own, CF, SCENARIO)
    told = tiny_params()
    told["trainings"][CF][SCENARIO] = {"epochs": 1, "start": SCENARIO}
    told["methods"][CF]["network"] |= network
    write_params(told)
    return shipped


def test_a_training_starts_from_what_is_shipped_and_says_so(project: Path) -> None:
    assert "start" not in train(read_params()).facts
    shipped = ship(project)
    params = read_params()
    barely = getattr(params.train, CF).model_copy(update={"learning_rate": 1e-9})
    started = train(changed(params, "train", **{CF: barely}))
    assert started.facts["start"] == SCENARIO
    assert started.facts["start_md5"] == content_md5(shipped)
    for name, value in read_weights(shipped, CF).items():
        if not is_buffer(name, CF):
            torch.testing.assert_close(started.weights[name], value, rtol=0, atol=1e-6)


def test_other_weights_to_start_from_are_another_training(project: Path) -> None:
    shipped = ship(project)
    before = training_params(read_params(), UNSEEN_CF)
    write_weights(shipped, {}, {"method": CF})
    assert training_params(read_params(), UNSEEN_CF) != before


def test_refuses_to_start_from_weights_that_are_not_there(project: Path) -> None:
    ship(project).unlink()
    key = f"trainings.{CF}.{SCENARIO}.start '{SCENARIO}' needs weights at "
    assert key in refusal("train", instance(f"train@{SCENARIO}-{CF}").argv)


def test_refuses_to_start_from_another_network(project: Path) -> None:
    shipped = ship(project, feature_dim=24)
    said = refusal("train", instance(f"train@{SCENARIO}-{CF}").argv)
    assert f"{shipped.relative_to(project)} does not fit {CF} as params.yaml has it: " in said


@pytest.mark.usefixtures("project")
def test_a_variant_has_the_ablations_budget_and_says_what_it_varies() -> None:
    variant = {"representation": "twist", "scaling": "standardised"}
    trained = train(read_params(), CF, variant)
    assert trained.facts["epochs"] == 2
    assert trained.facts["settings"] == ["representation=twist,scaling=standardised"]
    assert trained.weights["space.mean"].shape == (6,)
    assert (trained.weights["space.deviation"] != 1).all()
    assert "settings" not in train(read_params()).facts
    told = training_params(read_params(), replace(UNSEEN_CF, variant=variant))
    assert told["network"]["representation"] == "twist"
    assert told["epochs"] == 2


@pytest.mark.usefixtures("project")
def test_variants_start_from_the_same_draws() -> None:
    source, target = (train(read_params(), CF, {"fusion": name}) for name in ("source", "target"))
    first = [trained.curve[0].losses["chamfer"] for trained in (source, target)]
    assert first[0] == pytest.approx(first[1], rel=0.2)
    assert not same(source.weights, target.weights)


@pytest.mark.usefixtures("project")
def test_a_key_that_the_network_has_not_is_refused() -> None:
    with pytest.raises(ValueError, match="the network of pcrdiffusion_cb has no fusion to vary"):
        train(read_params(), CB, {"fusion": "source"})

"""The ``pcrdiff`` command. Everything slow is imported by the command that needs it."""

import getpass
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from pipeline.compute.stage import sentence

if TYPE_CHECKING:
    from pipeline.command.doctor import Level


class OneSentence(TyperGroup):
    """Wrong input is one sentence on stderr and exit code 1, never a traceback."""

    def invoke(self, ctx: Any) -> Any:  # noqa: ANN401  typer's own signature
        """Run the command."""
        try:
            return super().invoke(ctx)
        except (ValueError, OSError, MemoryError, OverflowError, RecursionError) as error:
            typer.echo(f"pcrdiff: {sentence(error)}", err=True)
            raise typer.Exit(1) from error


app = typer.Typer(
    cls=OneSentence,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Point cloud registration by diffusion, reproducible with DVC and MLflow.",
)
mlflow_app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Send finished stages to MLflow, and look at them.",
)
app.add_typer(mlflow_app, name="mlflow")

DOUBTED = 3
"""The exit code of an answer that is not to be trusted."""
COLOURS: "dict[Level, str]" = {"ok": "green", "warning": "yellow", "error": "red"}


@app.command()
def plan(
    targets: Annotated[list[str] | None, typer.Argument(help="Stages; all if none.")] = None,
) -> None:
    """Show which stages `dvc repro` would run and why, and run none."""
    from pipeline.command.plan import plan_stages

    found = list(plan_stages(_root(), targets or []))
    for stage, why in found:
        typer.echo(f"{stage}  ({why})")
    typer.echo(f"{len(found)} stages would run")


@app.command(name="repro")
def run_pipeline(
    targets: Annotated[list[str] | None, typer.Argument(help="Stages; all if none.")] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", "-j", min=1, help="Stages at once; else as many as fit.")
    ] = None,
) -> None:
    """Run what `dvc repro` would run, independent stages at the same time."""
    from pipeline.command.repro import Finished, repro, timings

    root = _root()
    os.chdir(root)

    def tell(ended: Finished) -> None:
        typer.echo(f"{ended.seconds:7.1f} s  {ended.stage}")

    started = time.monotonic()
    finished = repro(root, targets or [], jobs=jobs or _fitting_jobs(), tell=tell)
    for line in timings(finished):
        typer.echo(line)
    typer.echo(f"{len(finished)} stages in {time.monotonic() - started:.0f} s")


@app.command()
def profile(
    name: Annotated[str, typer.Argument(help="A file of profiles/: quick, tables, real, paper.")],
    force: Annotated[bool, typer.Option("--force", help="Drop values of your own.")] = False,
) -> None:
    """Write a profile into params.yaml and print what changed."""
    from pipeline.settings.profiles import write_profile

    changed = write_profile(_root(), name, force=force)
    for line in changed:
        typer.echo(line)
    typer.echo(f"params.yaml is now {name}: {len(changed)} values changed")


@mlflow_app.command("sync")
def mlflow_sync() -> None:
    """Send the journals of finished stages, and the stages DVC restored, to MLflow."""
    from pipeline.tracking.mlflow_sync import sync

    report = sync(_root())
    typer.echo(report.sentence(), err=bool(report.problems))
    raise typer.Exit(1 if report.problems else 0)


@mlflow_app.command("ui")
def mlflow_ui(port: Annotated[int, typer.Option(help="Port on 127.0.0.1.")] = 5000) -> None:
    """Open MLflow's pages on this project's store, for this machine only."""
    from pipeline.tracking.mlflow_runs import runs_page
    from pipeline.tracking.mlflow_store import artifacts_folder, is_server, public, tracking_uri
    from pipeline.tracking.mlflow_sync import open_store

    root = _root()
    uri = tracking_uri(root)
    if is_server(uri):
        typer.echo(f"the store is a server already: {public(uri)}")
        return
    # under a lock: a server that creates the tables may meet a stage doing it
    page = runs_page(*open_store(root))
    store = ["--backend-store-uri", uri]
    store += ["--default-artifact-root", artifacts_folder(uri, root) or uri]
    typer.echo(f"http://127.0.0.1:{port}/{page}")
    where = ["--host", "127.0.0.1", "--port", str(port), "--workers", "1"]
    become_module("mlflow", "server", *where, *store)


@app.command()
def real() -> None:
    """Run the pipeline on real data, as the experiment `real`, and bring its report back.

    Before it starts, it says what it will train, what that costs and where it writes.
    """
    from pipeline.command.real import plan_real, run_real

    for line in plan_real(_root()):
        typer.echo(line)
    for path in run_real(_root()):
        typer.echo(path)


@app.command()
def ship(
    method: Annotated[str, typer.Argument(help="A learned method.")],
    scenario: Annotated[str, typer.Argument(help="The scenario that it was trained on.")],
    card: Annotated[bool, typer.Option("--card", help="Only write the card again.")] = False,
) -> None:
    """Put the weights of a training, with their card, where they come with the code."""
    from pipeline.command.ship import ship as ship_weights
    from pipeline.command.ship import write_card

    root = _root()
    written = [write_card(root, method, scenario)] if card else ship_weights(root, method, scenario)
    for path in written:
        typer.echo(path.relative_to(root))


@app.command(name="register")
def register_two(
    source: Annotated[Path, typer.Argument(help="The cloud that moves.")],
    target: Annotated[Path, typer.Argument(help="The cloud that stays.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write the 4x4 pose here, as text.")
    ] = None,
    method: Annotated[
        str, typer.Option(help="auto, or starts from features, random or diffusion alone.")
    ] = "auto",
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Of the random draws.")] = 0,
) -> None:
    """Find the pose that lays one cloud on the other. Exit code 0: trusted, 3: in doubt, 1: error.

    Reads PLY, PCD, OFF, OBJ, STL, NPY, NPZ, XYZ, TXT, CSV and KITTI's BIN, in any unit.
    """
    from pipeline.command.register import register_files

    lines, trusted = register_files(source, target, output, method, as_json=json, seed=seed)
    for line in lines:
        typer.echo(line)
    raise typer.Exit(0 if trusted else DOUBTED)


@app.command()
def doctor() -> None:
    """Check what the pipeline needs, and say what is wrong."""
    from pipeline.command.doctor import examine

    levels = set()
    for finding in examine(_root()):
        levels.add(finding.level)
        typer.secho(f"{finding.level:8}", fg=COLOURS[finding.level], nl=False)
        typer.echo(f" {finding.sentence}")
    raise typer.Exit(1 if "error" in levels else 0)


@app.command()
def clean(
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only list.")] = False,
    days: Annotated[float, typer.Option(min=0, help="Keep checkpoints younger than this.")] = 7.0,
) -> None:
    """Remove what killed runs left: experiment folders, old checkpoints, sent journals."""
    from pipeline.command.clean import leftovers, remove

    root = _root()
    found = leftovers(root, days=days)
    for leftover in found:
        if not dry_run:
            remove(leftover)
        typer.echo(f"{leftover.what}: {leftover.path.relative_to(root)}")
    typer.echo(f"{len(found)} {'to remove' if dry_run else 'removed'}")


def become_module(*words: str) -> NoReturn:
    """Go on as ``python -m <words>`` in this very process, so that signals and codes are its own."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    sys.stdout.flush()
    command = [sys.executable, "-m", *words]
    os.execve(sys.executable, command, {**os.environ, "PATH": path})


def _fitting_jobs() -> int:
    """Return how many stages the cores that this process may use have room for."""
    from pipeline.settings.params import read_params

    mine = getattr(os, "sched_getaffinity", None)  # under taskset and SLURM fewer than there are
    cores = len(mine(0)) if mine else os.cpu_count() or 1
    return max(1, cores // read_params().threads)


def _root() -> Path:
    from pipeline.tracking.run import project_root

    _check_user()
    return project_root()


def _check_user() -> None:
    """Refuse a user without home or name, as containers have them: DVC and MLflow ask for both."""
    who = f"user {os.getuid()} is not in this machine's list of users"
    try:
        Path.home()
    except RuntimeError as error:
        needed = f"DVC and MLflow need a home folder, and {who}"
        raise ValueError(f"{needed}: set HOME to a folder that can be written") from error
    try:
        getpass.getuser()
    except (KeyError, OSError) as error:  # OSError from Python 3.13 on
        raise ValueError(f"DVC needs a user's name, and {who}: set LOGNAME to any name") from error

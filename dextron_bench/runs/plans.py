"""What to run: a plan for a method, a source of reaches and a seed, and the run that it resolves to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from dextron_bench.methods import registry, specs
from dextron_bench.methods import weights as method_weights
from dextron_bench.methods.learners import Learner, PolicyTransfer
from dextron_bench.methods.registry import Entrant
from dextron_bench.splits.loading import ranking_splits, splits_under
from dextron_bench.storage import schemas
from dextron_bench.storage.run_folder import RunFolder, run_folders
from dextron_bench.training.jobs import TrainingJob

ENTRANT = "entrant"  # Folder below the runs of another process, with the files of the method.


@dataclass(frozen=True, slots=True)
class Plan:
    """What a user asks for: a method on the splits of a source with one seed.

    The first `record` episodes of each split are recorded. `settings` are the method's own. If `weights` is a file,
    the method acts with these weights and trains nothing. No `splits` means all that rank methods.
    """

    method: str
    reaches: str
    splits: tuple[str, ...] = ()
    seed: int = 0
    record: int = 0
    settings: Mapping[str, Any] = field(default_factory=dict)
    weights: Path | None = None


@dataclass(frozen=True, slots=True)
class Run:
    """A plan resolved once: the method itself, its label, and the source of reaches that it is evaluated on.

    `learner` trains the weights that the method acts with: the method itself, the source policy of a transfer, or None.
    """

    plan: Plan
    method: Entrant
    learner: Learner | None
    label: str
    source: str

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of the splits to evaluate on; raises UnknownSplit if the source has none that rank methods."""
        return self.plan.splits or ranking_splits(self.source)

    @property
    def seed(self) -> int:
        """The seed of the agent."""
        return self.plan.seed

    @property
    def about(self) -> dict[str, Any]:
        """Method, source of reaches and seed, as results and recordings say them."""
        return {"method": self.label, "reaches": self.source, "seed": self.seed}

    def with_seed(self, seed: int) -> Run:
        """The same run with another seed."""
        return replace(self, plan=replace(self.plan, seed=seed))

    def with_weights(self, seed: int, weights: Path) -> Run:
        """The same run with another seed, which acts with the weights of a file."""
        return replace(self, plan=replace(self.plan, seed=seed, weights=weights))

    def folder(self, runs: Path) -> RunFolder:
        """The run's folder."""
        return RunFolder.of(runs, self.label, self.source, self.seed)

    def config(self) -> dict[str, Any]:
        """What the run depends on; a folder belongs to one config."""
        return registry.run_config(self.method, self.source, self.seed)

    def training_job(self, runs: Path, threads: int = 0, device: str = "cpu") -> TrainingJob | None:
        """The training that the run needs; None if the plan names weights or nothing is trained."""
        if self.learner is None or self.plan.weights:
            return None
        return TrainingJob(self.learner, self.training_source, runs, threads, device)

    @property
    def training_source(self) -> str:
        """The source of reaches that the learner is trained on."""
        return registry.run_source(self.learner or self.method, self.plan.reaches)


def resolve(plan: Plan) -> Run:
    """The run of a plan; raises UnknownMethod, BadSettings, AgentError."""
    method = registry.create(plan.method, plan.settings, plan.reaches)
    policy = method.source_policy if isinstance(method, PolicyTransfer) else method
    learner = policy if isinstance(policy, Learner) else None
    return Run(plan, method, learner, registry.label(method), registry.run_source(method, plan.reaches))


def without_file(plan: Plan) -> tuple[Plan, dict[str, Path]]:
    """The plan for another process, with only the name of the file that its method lies in, if any.

    Also returns this file by its place below the folder of all runs.
    """
    spec = specs.parse(plan.method)
    if spec.file is None:
        return plan, {}
    return replace(plan, method=str(replace(spec, location=spec.file.name))), {f"{ENTRANT}/{spec.file.name}": spec.file}


def with_file(plan: Plan, runs: Path) -> Plan:
    """The plan with its method's file below a folder of runs; undoes `without_file`."""
    spec = specs.parse(plan.method)
    if spec.file is None:
        return plan
    return replace(plan, method=str(replace(spec, location=str(runs / ENTRANT / spec.file))))


def with_tracks(run: Run, names: Sequence[str]) -> Run:
    """The run on its splits, and on each of them under each track; raises UnknownTrack, UnknownSplit."""
    added = [name for track in names for name in splits_under(run.source, run.splits, track)]
    return replace(run, plan=replace(run.plan, splits=(*run.splits, *added))) if added else run


def beside_other_code(run: Run, runs: Path) -> Run:
    """The run, with a hash in its label if the folder of its label holds runs of another version of its file.

    A learner keeps its label, which its training and its weights have too.
    """
    code = run.config()["code"]
    if run.learner is not None or not code["sha256"]:
        return run
    folders = [folder for folder in run_folders(runs, run.label) if folder.config.exists()]
    if all(schemas.read(folder.config, schemas.CONFIG).get("code") == code for folder in folders):
        return run
    return replace(run, label=f"{run.label}+{code['sha256'][:8]}")


def with_shipped_weights(run: Run, seeds: Sequence[int]) -> list[Run]:
    """The run with the weights that ship, for these seeds; for all that ship if `seeds` is empty.

    Raises MissingWeights.
    """
    if run.learner is None:
        raise no_weights(run)
    source = run.training_source
    files = method_weights.shipped(run.learner, source)
    if missing := [seed for seed in seeds or (0,) if seed not in files and (seeds or not files)]:
        others = method_weights.shipped_labels(run.learner, source)
        command = f"dextron-bench run {registry.as_flags(run.plan.method, run.plan.settings)}"
        raise method_weights.MissingWeights(
            f"no weights of {run.label!r} on {run.plan.reaches} reaches ship for seed {missing[0]}; train them with "
            f"`{command} --reaches {run.plan.reaches} --seed {missing[0]}`"
            + (f", or use weights that ship: {', '.join(others)}" if others else "")
        )
    return [run.with_weights(seed, files[seed]) for seed in seeds or files]


def no_weights(run: Run) -> method_weights.MissingWeights:
    """The error for a method that is asked for its weights and has none."""
    name = run.method.name
    return method_weights.MissingWeights(f"method {name!r} has no weights: `dextron-bench run` evaluates it")

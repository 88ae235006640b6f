"""The entry of a submission: an agent with a name, seeds and settings."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from dextron_bench.methods import registry, specs
from dextron_bench.methods.isolation.launch import Launch, prepare_launch
from dextron_bench.submissions import bundle, names
from dextron_bench.submissions.declaration import Declaration
from dextron_bench.world import model

FOLDER = "submissions"  # In the folder of runs.
MANIFEST_KINDS = {"method": "method", "module": "code", "file": "code", "policy": "policy", "command": "exec"}


class BadSubmission(ValueError):
    """An entry that cannot be submitted; the message says what is wrong."""


def whole_settings(spec: str, settings: dict[str, Any], reaches: str) -> dict[str, Any]:
    """An agent's settings; an installed method also has its defaults for the source of reaches.

    Raises BadSettings.
    """
    if spec in registry.installed_methods():
        return registry.settings_of(registry.create(spec, settings, reaches))
    return settings


@dataclass(frozen=True, slots=True)
class Entry:
    """What is submitted: an agent, by its spec, on a source of reaches, with seeds. Raises BadSubmission."""

    name: str
    spec: str
    reaches: str
    seeds: tuple[int, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    weights: Path | None = None
    declared: Declaration = field(default_factory=Declaration)
    trust: bool = False  # A policy's file may start without a sandbox.

    def __post_init__(self) -> None:
        if other := names.imitated(self.name, registry.installed_methods()):
            raise BadSubmission(f"the name {self.name!r} looks like the name of the method {other!r}; choose another")
        if len(self.seeds) > bundle.MOST_SEEDS:
            raise BadSubmission(f"a submission has at most {bundle.MOST_SEEDS} seeds, not {len(self.seeds)}")
        if sorted(self.seeds) != list(range(len(self.seeds))):
            raise BadSubmission("seeds must be 0, 1, 2 and so on, so that nobody can choose the best: --seed 0 1 2")
        if not registry.NAME.fullmatch(self.name) or len(self.name) > 64:
            raise BadSubmission(
                f"{self.name!r} is not a valid name: use up to 64 letters, digits and . _ + -, as in 'my-agent'"
            )

    @property
    def launch(self) -> Launch:
        """How to start the agent's process; raises AgentError."""
        return prepare_launch(self.spec, self.settings, self.weights, self.trust)

    def folder(self, runs: Path) -> Path:
        """The folder with the runs of its seeds."""
        return runs / FOLDER / self.name / self.reaches

    def manifest(self) -> dict[str, Any]:
        """Its entries in the manifest of its bundle."""
        spec = self.launch.spec
        text = str(replace(spec, location=spec.file.name) if spec.file else spec)
        agent: dict[str, Any] = {"kind": MANIFEST_KINDS[spec.kind], "spec": text, "settings": self.settings}
        agent["weights"] = self.weights.name if self.weights else ""
        return {
            "name": self.name,
            "reaches": self.reaches,
            "seeds": list(self.seeds),
            "agent": agent,
            "declared": asdict(self.declared),
            "physics": model.mjcf_hash(),
        }

    def files(self) -> dict[str, Path]:
        """The agent's own files, by name; with them it can run again."""
        return {file.name: file for file in (self.launch.spec.file, self.weights) if file}

    def in_folder(self, folder: Path) -> Entry:
        """The entry, with its files in a folder."""
        spec = specs.parse(self.spec)
        if spec.file is not None:
            spec = replace(spec, location=str(folder / spec.file.name))
        return replace(self, spec=str(spec), weights=folder / self.weights.name if self.weights else None)

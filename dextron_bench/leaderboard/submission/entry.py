"""What a submission enters: an agent under a name, with its seeds and settings."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from dextron_bench.leaderboard.submission.declaration import Declaration
from dextron_bench.methods import registry
from dextron_bench.methods.isolation.launch import Launch, prepare_launch
from dextron_bench.world import model

FOLDER = "submissions"  # In the folder of runs.
MANIFEST_KINDS = {"method": "method", "module": "code", "file": "code", "policy": "policy", "command": "exec"}


class BadSubmission(ValueError):
    """What cannot be submitted; the message says what would be right."""


def settle(spec: str, text: str, reaches: str) -> dict[str, Any]:
    """An agent's settings from JSON; of an installed method all, as it is made for a source of reaches.

    Raises BadSubmission, BadSettings.
    """
    found = _read(text)
    return (
        registry.settings_of(registry.create(spec, found, reaches)) if spec in registry.installed_methods() else found
    )


def _read(text: str) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except ValueError as error:
        raise BadSubmission(f"--settings is no JSON ({error})") from error
    if not isinstance(found, dict):
        raise BadSubmission("settings are a JSON object, like '{\"near\": 0.05}'")
    return found


@dataclass(frozen=True, slots=True)
class Entry:
    """What is submitted: an agent by the words that name it, on a source of reaches, with seeds."""

    name: str
    spec: str
    reaches: str
    seeds: tuple[int, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    weights: Path | None = None
    declared: Declaration = field(default_factory=Declaration)

    def __post_init__(self) -> None:
        if self.name.casefold().split("-")[0] in registry.installed_methods():
            raise BadSubmission(f"the name {self.name!r} begins like that of an installed method; choose another")
        if sorted(self.seeds) != list(range(len(self.seeds))):
            raise BadSubmission("seeds are 0, 1, 2 and so on, so that nobody chooses the best: --seed 0 1 2")
        if not registry.NAME.fullmatch(self.name) or len(self.name) > 64:
            raise BadSubmission(
                f"the name {self.name!r} is not one: use up to 64 letters, digits and . _ + -, as in 'my-agent'"
            )

    @property
    def launch(self) -> Launch:
        """What starts the agent's process."""
        return prepare_launch(self.spec, self.settings, self.weights)

    def folder(self, runs: Path) -> Path:
        """Where the runs of its seeds lie."""
        return runs / FOLDER / self.name / self.reaches

    def told(self) -> dict[str, Any]:
        """What its manifest says of it."""
        spec = self.launch.spec
        text = str(replace(spec, location=spec.file.name) if spec.file else spec)
        agent: dict[str, Any] = {"kind": MANIFEST_KINDS[spec.kind], "spec": text, "settings": self.settings}
        agent["weights"] = self.weights.name if self.weights else ""
        told = {"name": self.name, "reaches": self.reaches, "seeds": list(self.seeds), "agent": agent}
        return {**told, "declared": asdict(self.declared), "physics": model.mjcf_hash()}

    def files(self) -> dict[str, Path]:
        """The agent's own files, that it can be run again from, by name."""
        return {file.name: file for file in (self.launch.spec.file, self.weights) if file}

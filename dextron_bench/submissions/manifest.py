"""What JSON files of strangers may hold: the manifest of a bundle, and the results in it.

Entries that a record does not name are refused, and texts, lists and numbers are limited.
"""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import UNSET, Meta, UnsetType, field

from dextron_bench.methods.settings import Settings
from dextron_bench.storage.atomic import Json
from dextron_bench.storage.records import Count, Number, Record, Scores

FORMAT: Literal[1] = 1
Text100 = Annotated[str, Meta(max_length=100)]
Text200 = Annotated[str, Meta(max_length=200)]
Text500 = Annotated[str, Meta(max_length=500)]
Sha256 = Annotated[str, Meta(pattern=r"^[0-9a-f]{64}$")]
Name = Annotated[str, Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9._+-]{0,63}$")]
Seed = Annotated[int, Meta(ge=0, le=999_999)]
Steps = Annotated[int, Meta(ge=0, le=10**15)]
AgentKind = Literal["method", "code", "policy", "exec"]
SplitName = Literal["train", "val", "test", "unseen-reach", "unseen-subject", "hard", "open"]
Extension = Annotated[str, Meta(pattern=r"^[a-z0-9_]{1,40}$")]


class Strict(Record, frozen=True, forbid_unknown_fields=True):
    """A record that refuses entries that it does not name."""


class Agent(Strict, frozen=True):
    """The agent: how it starts, with which settings, and the name of its file of weights, empty if it has none."""

    kind: AgentKind
    spec: Annotated[str, Meta(max_length=1000)]
    settings: Settings
    weights: Text200


class Declared(Strict, frozen=True):
    """What the authors declare (see `Declaration`)."""

    frames: Steps | None
    demonstrations: Steps | None
    hours: Annotated[float, Meta(ge=0.0, le=1e9)] | None
    hardware: Text200
    privileged: bool
    authors: Text500
    url: Annotated[str, Meta(max_length=500, pattern=r'^(https?://[^\s<>"]+)?$')]
    notes: Annotated[str, Meta(max_length=2000)]
    rule: bool = False


class Manifest(Strict, frozen=True):
    """The manifest of a bundle; `files` are the SHA-256 of all its files."""

    format: Literal[1]
    name: Name
    reaches: Literal["real", "synthetic"]
    seeds: Annotated[list[Seed], Meta(min_length=1, max_length=100)]
    agent: Agent
    declared: Declared
    physics: Sha256
    files: dict[str, Sha256]


class _Machine(Strict, frozen=True):
    system: Text200
    cpu: Text200
    cores: int | None
    vector_extensions: Annotated[list[Extension], Meta(max_length=100)] | UnsetType | None = UNSET


class _Provenance(Strict, frozen=True):
    git: Text100 | None
    dirty: bool | None
    versions: dict[str, Text100 | None]
    python: Text100
    machine: _Machine
    physics: Text100


class _SplitScores(Strict, frozen=True):
    digest: Sha256
    scores: Scores
    failed: Count
    causes: dict[str, Count]
    closing_lag: Number | None
    actions: list[Annotated[str, Meta(pattern=r"^[0-9a-f]{12}$")]] = field(default_factory=list)


class ClaimedResult(Strict, frozen=True):
    """A result in a bundle. `result_files.read_result` also checks the parts that hold anything here."""

    method: Name
    reaches: Literal["real", "synthetic", "minjerk"]
    seed: Count
    splits: Annotated[dict[SplitName, _SplitScores], Meta(min_length=1)]
    provenance: _Provenance
    tier: Literal["self-reported", "replayed", "re-run"] | UnsetType = UNSET
    declared: dict[str, Json] = field(default_factory=dict)
    maker: dict[str, Json] = field(default_factory=dict)
    training: dict[str, Json] = field(default_factory=dict)
    privileged: Text200 = ""

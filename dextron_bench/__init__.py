"""A benchmark of grasping with a prosthetic hand that a person moves.

These names are the public API. Each is loaded at its first use, so that `import dextron_bench` stays quick. The import
registers the environment `dextron_bench/Grasp-v0` with Gymnasium. Beside these names, the modules `errors`,
`world.gym`, `world.suite`, `world.model`, `world.task` and `success.network` are public; all other modules are private.
"""

import warnings
from importlib import import_module
from typing import TYPE_CHECKING, Any

from dextron_bench.world.registration import register_environments

if TYPE_CHECKING:
    from dextron_bench.errors import DextronError
    from dextron_bench.evaluation.diagnosis import diagnose
    from dextron_bench.evaluation.episodes import Episode
    from dextron_bench.evaluation.replay import replay
    from dextron_bench.evaluation.rollout import rollout
    from dextron_bench.experts.policies import Case, Expert, ExpertAgent
    from dextron_bench.methods.agents import Agent, AgentError
    from dextron_bench.methods.exact import Perceptron
    from dextron_bench.methods.learners import Learner, Trainer, TrainingSetup
    from dextron_bench.reaches.recorded.cache import MissingData
    from dextron_bench.reaches.setting import Setting
    from dextron_bench.reaches.sources import open_source
    from dextron_bench.recording.episode_file import read as read_recording
    from dextron_bench.splits.loading import Split, UnknownSplit, load_split
    from dextron_bench.storage.atomic import DamagedFile
    from dextron_bench.success.network import SuccessModel
    from dextron_bench.world.suite import load as load_environment

    __version__: str

__all__ = [
    "Agent",
    "AgentError",
    "Case",
    "DamagedFile",
    "DextronError",
    "Episode",
    "Expert",
    "ExpertAgent",
    "Learner",
    "MissingData",
    "Perceptron",
    "Setting",
    "Split",
    "SuccessModel",
    "Trainer",
    "TrainingSetup",
    "UnknownSplit",
    "__version__",
    "diagnose",
    "load_environment",
    "load_split",
    "open_source",
    "read_recording",
    "replay",
    "rollout",
]

_HOMES = {  # The module of each public name, and its name there if that differs.
    "Agent": "methods.agents",
    "AgentError": "methods.agents",
    "Case": "experts.policies",
    "DamagedFile": "storage.atomic",
    "DextronError": "errors",
    "Episode": "evaluation.episodes",
    "Expert": "experts.policies",
    "ExpertAgent": "experts.policies",
    "Learner": "methods.learners",
    "MissingData": "reaches.recorded.cache",
    "Perceptron": "methods.exact",
    "Setting": "reaches.setting",
    "Split": "splits.loading",
    "SuccessModel": "success.network",
    "Trainer": "methods.learners",
    "TrainingSetup": "methods.learners",
    "UnknownSplit": "splits.loading",
    "diagnose": "evaluation.diagnosis",
    "load_environment": "world.suite:load",
    "load_split": "splits.loading",
    "open_source": "reaches.sources",
    "read_recording": "recording.episode_file:read",
    "replay": "evaluation.replay",
    "rollout": "evaluation.rollout",
}
_RENAMED = {"Track": "TrainingSetup"}  # Names of earlier versions.


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("dextron-bench")
    if name in _RENAMED:
        warnings.warn(f"dextron_bench.{name} is now {_RENAMED[name]}", DeprecationWarning, stacklevel=2)
        name = _RENAMED[name]
    if name not in _HOMES:
        raise AttributeError(f"module 'dextron_bench' has no public name {name!r}; see dextron_bench.__all__")
    module, _, other = _HOMES[name].partition(":")
    value = getattr(import_module(f"dextron_bench.{module}"), other or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


register_environments()

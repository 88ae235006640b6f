"""From the first line of a training to a submitted row: SAC of Stable-Baselines3 on reaches that are ranked.

`pip install stable-baselines3`, then `python examples/sb3_to_board.py`. It trains on the settings of `train`, saves the
policy as a TorchScript file, and runs these two commands:

    dextron-bench check sb3-sac.pt
    dextron-bench submit sb3-sac.pt --name sb3-sac --seed 0

A policy's file plays in a sandbox (bubblewrap); `--trust` plays it without one.
"""

from pathlib import Path

import gymnasium
import torch
import tyro
from stable_baselines3 import SAC
from stable_baselines3.common.monitor import Monitor

from dextron_bench import load_split
from dextron_bench.cli.main import main as command_line
from dextron_bench.reaches.sources import RankedSource


class MeanAction(torch.nn.Module):
    """The deterministic policy alone: states (N, 48) to closing speeds (N, 1)."""

    def __init__(self, agent: SAC) -> None:
        super().__init__()
        self.layers, self.mean = agent.actor.latent_pi, agent.actor.mu

    def forward(self, states: torch.Tensor) -> torch.Tensor:
        return torch.tanh(self.mean(self.layers(states)))


def train(reaches: str, steps: int) -> SAC:
    """Trains for some control steps on the settings of `train`, one after another."""
    settings = [case.setting for case in load_split(reaches, "train").cases]
    env = Monitor(gymnasium.make("dextron_bench/Grasp-v0", reaches=reaches, settings=settings))
    agent = SAC("MlpPolicy", env, learning_starts=min(10_000, steps // 2), verbose=1, seed=0, device="cpu")
    return agent.learn(steps)


def save(agent: SAC, file: Path) -> None:
    """Writes the policy as TorchScript, which runs without Stable-Baselines3."""
    torch.jit.save(torch.jit.trace(MeanAction(agent).eval(), torch.zeros(1, 48)), file)


def main(name: str = "sb3-sac", reaches: RankedSource = "synthetic", steps: int = 300_000, trust: bool = False) -> int:
    """Trains, saves, checks and submits a policy; returns the exit code of the first command that fails."""
    file = Path(f"{name}.pt")
    save(train(reaches, steps), file)
    common = ["--reaches", reaches, *(["--trust"] if trust else [])]
    if code := command_line(["check", str(file), *common]):
        return code
    return command_line(["submit", str(file), "--name", name, "--seed", "0", *common])


if __name__ == "__main__":
    raise SystemExit(tyro.cli(main))

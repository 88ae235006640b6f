"""From the first line of a training to a submitted row: a policy with the interface of LeRobot's policies.

`python examples/lerobot_to_board.py` plays the experts of `train`, clones them in chunks of actions, saves the weights
as safetensors, and runs these two commands. The file is also the agent: `LeRobotStyle` is the class that they name.

    dextron-bench check examples/lerobot_to_board.py:LeRobotStyle --weights lerobot-style.safetensors
    dextron-bench submit examples/lerobot_to_board.py:LeRobotStyle --weights lerobot-style.safetensors \
        --name lerobot-style --seed 0

For a policy of LeRobot, build it instead of `ChunkPolicy`. Whoever runs the agent again needs LeRobot installed, too.
"""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
import tyro
from safetensors.torch import save_file
from torch import Tensor, nn

STATE, CHUNK, WIDTH = 48, 8, 256
BATCH, RATE = 512, 1e-3
OBSERVATION, ACTION, PADDING = "observation.state", "action", "action_is_pad"  # LeRobot's names in a batch.


class ChunkPolicy(nn.Module):
    """A network that maps a state to the next CHUNK closing speeds; a queue hands them out one by one."""

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(STATE))
        self.register_buffer("deviation", torch.ones(STATE))
        layers = nn.Linear(STATE, WIDTH), nn.ReLU(), nn.Linear(WIDTH, WIDTH), nn.ReLU(), nn.Linear(WIDTH, CHUNK)
        self.network = nn.Sequential(*layers)
        self.reset()

    def reset(self) -> None:
        """Begins a new episode."""
        self._queue: deque[Tensor] = deque()

    def predict_action_chunk(self, batch: Mapping[str, Tensor]) -> Tensor:
        """The next speeds (B, CHUNK, 1) for states (B, 48)."""
        scaled = (batch[OBSERVATION] - self.get_buffer("mean")) / self.get_buffer("deviation")
        return self.network(scaled.clamp(-10.0, 10.0)).tanh()[..., None]

    def select_action(self, batch: Mapping[str, Tensor]) -> Tensor:
        """The speeds (B, 1) of this step; the network runs only when the queue is empty."""
        if not self._queue:
            self._queue.extend(self.predict_action_chunk(batch).unbind(dim=1))
        return self._queue.popleft()

    def forward(self, batch: Mapping[str, Tensor]) -> Tensor:
        """The mean absolute error of the speeds that the expert has acted, without the padding after its end."""
        errors = (self.predict_action_chunk(batch) - batch[ACTION]).abs()[..., 0]
        return errors[~batch[PADDING]].mean()


class PolicyPerRow:
    """Plays N episodes at once: each row has a copy of the policy, with a queue of its own and the same weights."""

    rows_are_independent = True

    def __init__(self, policy: ChunkPolicy) -> None:
        self._policy, self._rows = policy.eval(), list[ChunkPolicy]()

    def reset(self, episodes: np.ndarray) -> None:
        """Empties the queues of the rows that begin a new episode; the other rows go on with their chunks."""
        missing = int(episodes.max(initial=-1)) + 1 - len(self._rows)
        self._rows += [copy.copy(self._policy) for _ in range(missing)]
        for row in episodes.tolist():
            self._rows[row].reset()

    @torch.inference_mode()
    def act(self, states: np.ndarray) -> np.ndarray:
        """Maps states (N, 48) to closing speeds (N, 1) in [-1, 1]."""
        rows = zip(self._rows, torch.as_tensor(states, dtype=torch.float32), strict=True)
        speeds = torch.cat([policy.select_action({OBSERVATION: state[None]}) for policy, state in rows])
        return speeds.clamp(-1.0, 1.0).double().numpy()


class LeRobotStyle:
    """What `check` and `submit` are given: a class that makes the agent from the arrays of a safetensors file."""

    name = "lerobot-style"

    def policy(self, weights: Mapping[str, np.ndarray]) -> PolicyPerRow:
        """The agent that acts with these weights."""
        policy = ChunkPolicy()
        policy.load_state_dict({name: torch.as_tensor(array) for name, array in weights.items()})
        return PolicyPerRow(policy)


def demonstrations(reaches: str, episodes: int) -> dict[str, Tensor]:
    """Each step of the experts' episodes on the first rows of `train`: its state and the chunk that begins there."""
    from dextron_bench import ExpertAgent, load_split, open_source, rollout  # Not for agents: this plays the simulator.

    states, chunks, padding = [], [], []
    for _, episode in rollout(ExpertAgent(), open_source(reaches), load_split(reaches, "train").cases[:episodes]):
        steps = np.arange(len(episode.actions))[:, None] + np.arange(CHUNK)
        states.append(episode.states[:-1])
        chunks.append(episode.actions[np.minimum(steps, len(episode.actions) - 1)])
        padding.append(steps >= len(episode.actions))
    arrays = {OBSERVATION: np.concatenate(states), ACTION: np.concatenate(chunks), PADDING: np.concatenate(padding)}
    return {name: torch.as_tensor(a, dtype=None if a.dtype == bool else torch.float32) for name, a in arrays.items()}


def train(data: Mapping[str, Tensor], steps: int) -> ChunkPolicy:
    """Fits a policy to demonstrations."""
    torch.manual_seed(0)
    policy = ChunkPolicy()
    policy.get_buffer("mean").copy_(data[OBSERVATION].mean(dim=0))
    policy.get_buffer("deviation").copy_(data[OBSERVATION].std(dim=0) + 1e-4)
    optimiser = torch.optim.Adam(policy.parameters(), lr=RATE)
    for _ in range(steps):
        rows = torch.randint(len(data[OBSERVATION]), (BATCH,))
        loss = policy({name: values[rows] for name, values in data.items()})
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    return policy


def main(name: str = "lerobot-style", reaches: str = "synthetic", episodes: int = 400, steps: int = 5000) -> int:
    """Trains, saves, checks and submits a policy; returns the exit code of the first command that fails."""
    from dextron_bench.cli.main import main as command_line

    policy, file = train(demonstrations(reaches, episodes), steps), Path(f"{name}.safetensors")
    save_file(policy.state_dict(), file)
    agent = [f"{__file__}:LeRobotStyle", "--weights", str(file), "--reaches", reaches]
    return command_line(["check", *agent]) or command_line(["submit", *agent, "--name", name, "--seed", "0"])


if __name__ == "__main__":
    raise SystemExit(tyro.cli(main))

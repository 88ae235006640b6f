"""The paper's expert in the simulated-trajectory world, through dm_control: `python examples/dm_control_expert.py`."""

import numpy as np

from dextron_bench.experts.policies import Expert, ExpertAgent
from dextron_bench.world import suite


def main(episodes: int = 3) -> list[float]:
    """Plays and prints the returns of so many episodes, and returns them."""
    env, agent = suite.load("minjerk", seed=0), ExpertAgent()
    only = np.array([0])
    agent.assign(only, [Expert(gain=2.0, critical=0.15)])
    returns = []
    for _ in range(episodes):
        agent.reset(only)
        step, score = env.reset(), 0.0
        while not step.last():
            step = env.step(agent.act(step.observation["state"][None])[0])
            score += step.reward
        returns.append(score)
        print(f"return {score:.0f} of 20")
    return returns


if __name__ == "__main__":
    main()

"""The paper's expert on the source `minjerk`, through dm_control: `python examples/dm_control_expert.py`."""

import numpy as np

from dextron_bench.experts.policies import Expert, ExpertAgent
from dextron_bench.world import suite


def main(episodes: int = 3) -> list[float]:
    """Plays some episodes, prints their returns, and gives them back as a list."""
    env, agent = suite.load("minjerk", seed=0), ExpertAgent()
    episode = np.array([0])
    agent.assign(episode, [Expert(gain=2.0, critical=0.15)])
    returns = []
    for _ in range(episodes):
        agent.reset(episode)
        step, score = env.reset(), 0.0
        while not step.last():
            step = env.step(agent.act(step.observation["state"][None])[0])
            score += step.reward
        returns.append(score)
        print(f"return {score:.0f} of 20")
    return returns


if __name__ == "__main__":
    main()

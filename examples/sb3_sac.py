"""SAC from Stable-Baselines3: `pip install stable-baselines3`, then `python examples/sb3_sac.py`."""

import gymnasium
from stable_baselines3 import SAC
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor

import dextron_bench  # noqa: F401  # Registers the environment.


def main(reaches: str = "minjerk", steps: int = 20_000, episodes: int = 5) -> None:
    """Trains for some control steps, then prints the mean return over some episodes."""
    env = Monitor(gymnasium.make("dextron_bench/Grasp-v0", reaches=reaches))
    agent = SAC("MlpPolicy", env, learning_starts=min(1000, steps // 2), verbose=1, seed=0)
    agent.learn(steps)
    mean, spread = evaluate_policy(agent, env, n_eval_episodes=episodes)
    print(f"mean return {mean:.1f} of 20, deviation {spread:.1f}")


if __name__ == "__main__":
    main()

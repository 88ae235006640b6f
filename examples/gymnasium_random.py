"""Random actions in eight parallel episodes, through Gymnasium: `python examples/gymnasium_random.py`."""

import gymnasium

import dextron_bench  # noqa: F401  # Registers the environment.


def main(reaches: str = "minjerk", steps: int = 500) -> int:
    """Prints how each episode ends, and returns the number of finished episodes."""
    env = gymnasium.make_vec("dextron_bench/Grasp-v0", num_envs=8, reaches=reaches)
    env.action_space.seed(0)
    env.reset(seed=0)
    finished = 0
    for _ in range(steps):
        _, _, terminated, truncated, info = env.step(env.action_space.sample())
        for slot in (terminated | truncated).nonzero()[0]:
            finished += 1
            ending = "the bottle fell" if terminated[slot] else "time was up"
            print(f"{info['setting']['reach'][slot]}: return {info['episode_return'][slot]:.0f}, {ending}")
    return finished


if __name__ == "__main__":
    main()

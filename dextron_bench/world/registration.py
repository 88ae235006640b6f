"""Registration of the environments with Gymnasium, done by `import dextron_bench`.

Gymnasium 1 loads no plugins by itself. A program imports `dextron_bench`, or asks for the id
`dextron_bench:dextron_bench/Grasp-v0`, which makes Gymnasium import it.
"""

from __future__ import annotations

import gymnasium

from dextron_bench.reaches.timing import STEP_LIMIT

GRASP = "dextron_bench/Grasp-v0"


def register_environments() -> None:
    """Registers the single and the vector environment. Gymnasium imports the simulator when it makes one of them."""
    gymnasium.register(
        GRASP,
        entry_point="dextron_bench.world.gym:GraspEnv",
        vector_entry_point="dextron_bench.world.gym:GraspVectorEnv",
        max_episode_steps=STEP_LIMIT + 1,  # At 500, TimeLimit would also truncate an episode that terminates there.
    )

"""A benchmark of grasping for a prosthetic hand that a person moves."""

from dextron_bench.world.registration import register_with_gymnasium

register_with_gymnasium()

"""A benchmark of grasping for a prosthetic hand that a person moves."""

from dextron_bench.world.registration import register_environments

register_environments()

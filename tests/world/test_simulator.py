"""MuJoCo and dm_control are imported whatever MUJOCO_GL says: only pictures need its library."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dextron_bench.world import simulator, suite

MAKEFILE = Path(__file__).parents[2] / "Makefile"

BROKEN = {  # Packages of OpenGL as they behave without their library, by MUJOCO_GL; each is found before the real one.
    "egl": "'NoneType' object has no attribute 'glGetError'",  # libegl1 without libopengl0.
    "osmesa": "'NoneType' object has no attribute 'OSMesaCreateContext'",
}


def run(code: str, gl: str | None, folder: Path) -> str:
    """What Python code prints in a process in which PyOpenGL finds no library, with a value of MUJOCO_GL."""
    package = folder / "OpenGL"
    package.mkdir()
    (package / "__init__.py").write_text(f"raise AttributeError({BROKEN.get(gl or '', '')!r})\n")
    environment = {name: value for name, value in os.environ.items() if name not in simulator.GRAPHICS}
    environment |= {"PYTHONPATH": f"{folder}:{os.environ.get('PYTHONPATH', '')}", **({"MUJOCO_GL": gl} if gl else {})}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize("gl", [*BROKEN, "wrong", "disabled", None])
def test_a_world_is_built_and_the_variable_stays(gl: str | None, tmp_path: Path):
    code = "import os; from dextron_bench.world import model; print(model.load().nq, os.environ.get('MUJOCO_GL'))"
    assert run(code + "; assert 'PYOPENGL_PLATFORM' not in os.environ", gl, tmp_path) == f"25 {gl}"


@pytest.mark.slow
@pytest.mark.parametrize("gl", [*BROKEN, "wrong", None])
def test_the_dm_control_environment_steps(gl: str | None, tmp_path: Path):
    pytest.importorskip("dm_control")
    code = (
        "import dextron_bench as d; e = d.load_environment('minjerk', seed=0); e.reset(); print(e.step([0.0]).reward)"
    )
    assert run(code, gl, tmp_path) == "0.0"


@pytest.mark.slow
@pytest.mark.parametrize("gl", [*BROKEN, "wrong"])
def test_a_picture_says_what_is_missing(gl: str, tmp_path: Path):
    code = """
import numpy as np
from dextron_bench.world import model
from dextron_bench.world.rendering import renderer
try:
    renderer.render(np.zeros(48))
except renderer.NoGraphics as error:
    print(error)
"""
    text = run(code, gl, tmp_path)
    assert "cannot draw off screen" in text
    assert "apt install" in text


def test_an_error_that_has_nothing_to_do_with_graphics_is_raised():
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        simulator.load("no_such_module")


@pytest.mark.slow
def test_without_dm_control_one_line_says_how_to_add_it(tmp_path: Path):
    (tmp_path / "dm_control.py").write_text("raise ModuleNotFoundError('gone', name='dm_control')")
    code = """
import dextron_bench
try:
    dextron_bench.load_environment()
except ImportError as error:
    print(error)
"""
    text = run(code, None, tmp_path)
    assert text.startswith("the dm_control environment needs dm_control: pip install --no-deps dm-control ")
    assert "\n" not in text


def test_make_setup_adds_the_same_packages():
    assert f"DM_CONTROL = {suite.ADDITION}\n" in MAKEFILE.read_text()

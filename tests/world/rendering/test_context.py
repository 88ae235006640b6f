"""Contexts in new processes: forks, other threads, the order of two LLVMs, errors of missing libraries."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dextron_bench.world.rendering import context

START = """
import os, sys, threading
import numpy as np
from dextron_bench.world import model
from dextron_bench.world.rendering import context, renderer
state = np.concatenate([model.initial_qpos(), np.zeros(23)])
SIDE = renderer.CAMERAS["side"]
"""
FORK = """
kept = renderer.Renderer(64, 48)
picture = kept.render(state, SIDE)
pid = os.fork()
if pid == 0:
    for draw in (lambda: renderer.render(state, 64, 48), lambda: kept.render(state, SIDE)):
        try:
            draw()
        except renderer.NoGraphics as error:
            print(error, flush=True)
    kept.close()
    del kept
    os._exit(0)
assert os.waitpid(pid, 0)[1] == 0
assert (kept.render(state, SIDE) == picture).all()
"""
LOADED = "print('libLLVM' in open('/proc/self/maps').read(), flush=True)"
FORK_FIRST = """
pid = os.fork()
picture = renderer.render(state, 64, 48)
if pid == 0:
    os._exit(0)
print(os.waitpid(pid, 0)[1])
"""
THREADS = """
from dextron_bench.world.pictures import Pictures
pictures, other = Pictures(), Pictures()
drawn = [pictures.draw(state[None])]
def draw(one):
    drawn.append(one.draw(state[None]))
for act in (lambda: draw(pictures), lambda: draw(other), other.close):
    thread = threading.Thread(target=act)
    thread.start()
    thread.join()
drawn += [pictures.draw(state[None])]
print(len(drawn), all((one == drawn[0]).all() for one in drawn))
"""
TURNS = """
one, two = renderer.Renderer(64, 48), renderer.Renderer(96, 64)
pictures = [one.render(state, SIDE), two.render(state, SIDE), one.render(state, SIDE)]
two.close()
pictures += [one.render(state, SIDE)]
print(all((picture == pictures[0]).all() for picture in (pictures[2], pictures[3])), pictures[1].shape)
"""  # It ends without closing the other one.


def printed(code: str, **environment: str) -> str:
    """What a new interpreter prints for some code, which must end well and complain of nothing."""
    words = [sys.executable, "-c", START + code]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, env={**os.environ, **environment})
    assert not done.stderr, done.stderr
    assert done.returncode == 0
    return done.stdout.strip()


@pytest.mark.slow
def test_a_process_forked_from_one_that_has_drawn_refuses_to_draw():
    lines = printed(FORK).splitlines()
    assert len(lines) == 2
    assert all("forked from one that has drawn" in line and "'spawn' or 'forkserver'" in line for line in lines)


@pytest.mark.slow
def test_a_process_forked_before_the_first_picture_draws():
    assert printed(FORK_FIRST) == "0"


@pytest.mark.slow
def test_pictures_are_the_same_in_every_thread():
    assert printed(THREADS) == "4 True"


@pytest.mark.slow
def test_two_renderers_draw_in_turn_and_the_end_of_the_process_frees_them():
    assert printed(TURNS) == "True (64, 96, 3)"


@pytest.mark.slow
@pytest.mark.parametrize("content", ["print('imported')", "1 / 0"])
def test_triton_is_imported_before_mesas_llvm_and_may_fail(content: str, tmp_path: Path):
    """Mesa's LLVM, then Triton's, which torch's optimizers load, ended a process in a segmentation fault."""
    (tmp_path / "triton.py").write_text(f"{LOADED}\n{content}\n")
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    code = "renderer.render(state, 64, 48)\n" * 2
    lines = printed(code, PYTHONPATH=path).splitlines()
    assert lines == ["False", *(["imported"] if "print" in content else [])]  # Once, without LLVM.


@pytest.mark.parametrize("error", [AttributeError("'NoneType' object has no attribute 'eglQueryString'"), OSError("x")])
def test_every_error_of_a_library_says_what_to_install(error: Exception, monkeypatch: pytest.MonkeyPatch):
    def fail(name: str) -> None:
        if name.startswith("mujoco."):
            raise error

    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr(context, "import_module", fail)
    with pytest.raises(context.NoGraphics, match=r"libegl1 libopengl0 libgl1-mesa-dri\) or OSMesa .*libosmesa6"):
        context.create_context(64, 48)

"""Fences of drawing: kept until a later scene is done, and deleted then."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from raymarch.gpu.context import Context
from raymarch.gpu.fences import MOST, Fences
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
from tests.support.window_driver import ROOT

FILL = "#version 330 core\nout vec4 color;\nvoid main() { color = vec4(gl_FragCoord.x); }"

PAUSED = """#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <string.h>
#include <unistd.h>
int pthread_cond_broadcast(pthread_cond_t *waiters) {
    int (*broadcast)(pthread_cond_t *) = dlvsym(RTLD_NEXT, "pthread_cond_broadcast", "GLIBC_2.3.2");
    int result = broadcast(waiters);
    char name[32] = "";
    pthread_getname_np(pthread_self(), name, sizeof name);
    if (strstr(name, "llvmpipe")) usleep(200);
    return result;
}
"""
"""A drawing thread of llvmpipe wakes who waits for a fence, and is paused before it unlocks the fence."""

DRAWS = f"""
from raymarch.gpu.context import open_context
from raymarch.gpu.program import FULL_SCREEN, Program
from raymarch.gpu.targets import Target
with open_context("egl") as context, Program(context, FULL_SCREEN, {FILL!r}, None, "fill") as program:
    targets = [Target(context, (64, 64)) for _ in range(3)]
    for n in range(300):
        program.draw(targets[n % 3])
    print(targets[0].read()[0, 5, 0])
"""


@pytest.mark.may_skip
@pytest.mark.skipif(sys.platform != "linux" or shutil.which("cc") is None, reason="needs Linux and a C compiler")
def test_a_paused_drawing_thread_does_not_write_into_freed_memory(egl: Context, tmp_path: Path) -> None:
    """The allocator gives freed memory to others at once, so that such a write ends the process."""
    if not egl.driver.renderer.startswith("llvmpipe"):
        pytest.skip("another driver than llvmpipe")
    (tmp_path / "paused.c").write_text(PAUSED)
    library = tmp_path / "paused.so"
    subprocess.run(["cc", "-shared", "-fPIC", tmp_path / "paused.c", "-o", library, "-ldl"], check=True)
    tunables = "glibc.malloc.tcache_count=0:glibc.malloc.mxfast=0"
    environment = {
        **os.environ,
        "LD_PRELOAD": str(library),
        "GLIBC_TUNABLES": tunables,
        "LP_NUM_THREADS": "1",
        "PYTHONPATH": str(ROOT),
    }
    done = subprocess.run([sys.executable, "-c", DRAWS], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stdout.strip()) == (0, "5.5"), done.stderr


@pytest.mark.may_skip
def test_fences_are_kept_until_a_later_scene_is_done(egl: Context) -> None:
    if not egl.driver.renderer.startswith("llvmpipe"):
        pytest.skip("another driver than llvmpipe")
    fences = egl._fences
    with Target(egl, (4, 4)) as target, Program(egl, FULL_SCREEN, FILL, None, "fill") as program:
        egl.finish()
        assert len(fences._kept) <= 2  # the last, and that of the block of `finish`
        program.draw(target)
        program.draw(target)
        assert len(fences._kept) >= 3
        for _ in range(2 * MOST):
            program.draw(target)
            assert len(fences._kept) <= MOST


def test_others_keep_none(egl: Context) -> None:
    with egl.bound():
        fences = Fences(egl.gl, "another renderer")
        fences.keep()
        fences.finish()
    assert not fences._kept

"""What a GPU's compiler makes of a fragment shader, without a GPU.

Mesa's RADV compiles for AMD chips on no hardware (RADV_FORCE_FAMILY). A C program makes one pipeline and prints what
the driver reports. OpenGL text becomes Vulkan text by `#version 450` and the relaxed rules of glslang.
"""

from __future__ import annotations

import os
import re
import shutil
import struct
import subprocess
from dataclasses import dataclass
from pathlib import Path

SOURCE = Path(__file__).with_name("gpu_statistics.c")
FAMILIES = {"navi21": "RDNA 2", "vega10": "Vega", "polaris10": "Polaris"}
INVERSION = "inversion"  # of the mask of the rays that run, between the two sides of an `if`
DRIVERS = Path("/usr/share/vulkan/icd.d")
VERTEX = """#version 450
void main() {
    gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
"""


@dataclass(frozen=True)
class Statistics:
    """Of one shader on one chip.

    milliseconds : of the CPU, to compile. registers : vector registers. waves : that one unit holds at once.
    spilled : registers, vector and scalar. scratch : bytes. code : bytes. instructions, latency : counted and estimated
    by the driver.
    """

    milliseconds: float
    registers: int
    waves: int
    spilled: int
    scratch: int
    code: int
    instructions: int
    latency: int


def missing() -> str:
    """What this machine lacks, or ""."""
    programs = [name for name in ("gcc", "glslangValidator") if shutil.which(name) is None]
    files = [] if list(DRIVERS.glob("radeon*.json")) else ["Mesa's RADV driver"]
    return ", ".join([*programs, *files, *([] if programs or _has_headers() else ["the headers of Vulkan"])])


def _has_headers() -> bool:
    """Whether the C compiler finds the headers of Vulkan: where the system has them, or in C_INCLUDE_PATH."""
    asked = ["gcc", "-E", "-x", "c", "-"]
    return subprocess.run(asked, input="#include <vulkan/vulkan.h>\n", text=True, capture_output=True).returncode == 0


class Compiler:
    """Compiles texts in a folder. Raises RuntimeError for a text that glslang or the driver refuses."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._program = folder / "gpu_statistics"
        _run("gcc", "-O1", "-w", "-o", str(self._program), str(SOURCE), "-lvulkan")
        self._vertex = self._module(VERTEX, "vert")

    def statistics(self, text: str, family: str) -> Statistics:
        """The statistics of a fragment shader, `#version 330 core`."""
        said = self._said(text, family, "nocache")
        found = {name.strip(): value for name, value in re.findall(r"([\w .-]+)=([^;\n]+)", said)}
        milliseconds = float(re.findall(r"compile_ms=(\d+)", said)[0])
        names = "VGPRs", "Subgroups per SIMD", "Spilled VGPRs", "Spilled SGPRs", "Scratch size", "Code size"
        registers, waves, *spilled, scratch, code = (int(found[name]) for name in names)
        counted = int(found.get("Instructions", 0)), int(found.get("Latency", 0))
        return Statistics(milliseconds, registers, waves, sum(spilled), scratch, code, *counted)

    def loops(self, text: str, family: str) -> list[tuple[int, int]]:
        """The loops of a fragment shader; see `loops_of`."""
        return loops_of(max(self._said(text, family, "nocache,shaders").split("disasm:")[1:], key=len))

    def _said(self, text: str, family: str, asked: str) -> str:
        """What the program prints. asked : of the driver, RADV_DEBUG."""
        module = self._module(text.replace("#version 330 core", "#version 450", 1), "frag")
        (driver, *_) = DRIVERS.glob("radeon*.json")
        chip = {"RADV_FORCE_FAMILY": family, "VK_ICD_FILENAMES": str(driver), "RADV_DEBUG": asked}
        environment = {**os.environ, **chip, "XDG_RUNTIME_DIR": str(self.folder)}
        return _run(str(self._program), str(self._vertex), str(module), *_bindings(module), environment=environment)

    def _module(self, text: str, stage: str) -> Path:
        source, module = self.folder / f"shader.{stage}", self.folder / f"{stage}.spv"
        source.write_text(text)
        _run("glslangValidator", "-V", "-R", "--aml", "--amb", "-o", str(module), str(source))
        return module


def _run(*command: str, environment: dict[str, str] | None = None) -> str:
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300)
    if done.returncode:
        raise RuntimeError(f"{Path(command[0]).name}: {(done.stdout + done.stderr)[:600]}")
    return done.stdout + done.stderr


def loops_of(disassembly: str) -> list[tuple[int, int]]:
    """Of each loop, in order: the instructions of the shortest way through a turn, and of all its blocks."""
    code: list[tuple[str, str]] = []
    begins: dict[str, int] = {}
    for line in disassembly.splitlines():
        if block := re.match(r"(BB\d+):", line):
            begins[block[1]] = len(code)
        elif found := re.match(r"\s+((?:[vs]_|exp|image|buffer|ds_|global|scratch)\w*)([^;]*)", line):
            target = re.search(r"BB\d+", found[2])
            inverts = re.match(r"s_andn2_b64\s+exec,", found[1] + found[2])
            name = INVERSION if inverts else found[1]
            code.append((name, target[0] if target and "branch" in name else ""))
    return [
        (_shortest(code, begins, begins[target], end), end + 1 - begins[target])
        for end, (_, target) in enumerate(code)
        if target and begins[target] <= end
    ]


def _shortest(code: list[tuple[str, str]], begins: dict[str, int], start: int, end: int) -> int:
    """Fewest instructions from one to another, by branches that lead forwards. Rays that jump over one side of an `if`
    run the other side: at the inversion of the mask between the two no jump follows."""
    least = {end: 1}
    jumped = {end: 1}  # the same, for rays that arrive by a jump
    for i in range(end - 1, start - 1, -1):
        name, target = code[i]
        ways = [least.get(i + 1)] if name != "s_branch" else []
        ways += [jumped.get(begins[target])] if target and i < begins[target] else []
        least[i] = jumped[i] = 1 + min((way for way in ways if way is not None), default=len(code))
        if name == INVERSION and code[i + 1][0] == "s_cbranch_execz":
            jumped[i] = 2 + least.get(i + 2, len(code))
    return least[start]


def _bindings(module: Path) -> list[str]:
    """The bindings of a SPIR-V module: `u` for a block of uniforms, `s` for a sampler."""
    content = module.read_bytes()
    words, i = struct.unpack(f"<{len(content) // 4}I", content), 5
    binding: dict[int, int] = {}
    storage: dict[int, int] = {}
    while i < len(words):
        length, operation = words[i] >> 16, words[i] & 0xFFFF
        if operation == 71 and words[i + 2] == 33:  # OpDecorate, Binding
            binding[words[i + 1]] = words[i + 3]
        if operation == 59:  # OpVariable
            storage[words[i + 2]] = words[i + 3]
        i += length
    return [f"{number}:{'u' if storage.get(name) == 2 else 's'}" for name, number in binding.items()]

"""The shaders and the recipes for engines compile: GLSL ES 3.00, HLSL to SPIR-V. Chromium runs the GLSL (bench)."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from facewright.compress.runtime import GLSL, HLSL

RECIPES = Path(__file__).resolve().parents[2] / "docs" / "compress-engines.md"
COMPILER = shutil.which("glslangValidator")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no glslangValidator (Debian: glslang-tools)")

INCLUDE = "#extension GL_GOOGLE_include_directive : enable\n#include"  # glslang asks for it
UNREAL_TYPES = {
    "Offset": "float4",
    "Across": "float",
    "Count": "float",
    "Three": "float",
    "WeightSize": "float2",
    "UV": "float2",
}
UNREAL_TYPES |= {"UvScale": "float2"} | {f"{name}{i}": "float4" for name in ("Step", "Zero") for i in range(4)}


def compile_glsl(folder, body, head=""):
    path = folder / "shader.frag"
    path.write_text(f"#version 300 es\nprecision highp float;\n{head}{GLSL}{body}")
    return subprocess.run([COMPILER, path], capture_output=True, text=True)


def compile_hlsl(folder, text, entry, stage="frag"):
    (folder / "facezip.hlsl").write_text(HLSL)
    path = folder / "shader.hlsl"
    path.write_text(text)
    command = [COMPILER, "-D", "-V", "--auto-map-bindings", "--auto-map-locations", f"-I{folder}", "-S", stage]
    result = subprocess.run([*command, "-e", entry, "-o", folder / "shader.spv", path], capture_output=True, text=True)
    if result.returncode == 0 and shutil.which("spirv-val"):
        return subprocess.run(["spirv-val", folder / "shader.spv"], capture_output=True, text=True)
    return result


def recipe(engine, number):
    """The indented block of a section, without its indent."""
    section = RECIPES.read_text(encoding="utf-8").split(f"## {engine}\n")[1].split("\n## ")[0]
    blocks = re.findall(r"(?:^ {8}.*\n)+", section, re.MULTILINE)
    return re.sub(r"^ {8}", "", blocks[number], flags=re.MULTILINE)


def passed(result):
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(
    "head,body",
    [
        ("#define FACEZIP_PLACES 20\n", "void main() { color = facezipWeights(ivec2(gl_FragCoord.xy)); }"),
        ("", "in vec2 uv;\nvoid main() { color = facezip(uv); }"),
    ],
)
def test_glsl_compiles(tmp_path, head, body):
    passed(compile_glsl(tmp_path, f"out vec4 color;\n{body}\n", head))


def test_a_shader_that_is_wrong_does_not_compile(tmp_path):
    assert compile_glsl(tmp_path, "void main() { facezip(1.0); }\n").returncode != 0
    text = HLSL + "float4 main() : SV_Target { return FacezipWeights(facezipSum); }"
    assert compile_hlsl(tmp_path, text, "main").returncode != 0


@pytest.mark.parametrize("call", ["FacezipWeights(int2(position.xy))", "Facezip(uv)"])
def test_hlsl_compiles(tmp_path, call):
    text = f"{HLSL}float4 main(float4 position : SV_Position, float2 uv : TEXCOORD0) : SV_Target {{ return {call}; }}"
    passed(compile_hlsl(tmp_path, text, "main"))


@pytest.mark.parametrize("entry,stage", [("vertex", "vert"), ("fragment", "frag")])
def test_the_first_pass_for_unity_compiles(tmp_path, entry, stage):
    program = recipe("Unity", 0).split("HLSLPROGRAM")[1].split("ENDHLSL")[0]
    program = re.sub(r"#pragma.*", "", program).replace("#include", INCLUDE)
    passed(compile_hlsl(tmp_path, program, entry, stage))


@pytest.mark.parametrize("kind", ["float", "half"])
def test_the_custom_function_for_unity_compiles(tmp_path, kind):
    program = recipe("Unity", 1).replace("#include", INCLUDE)
    body = f"{kind}4 color; FacezipColor_{kind}({kind}2(uv), color); return float4(color);"
    program += f"float4 main(float2 uv : TEXCOORD0) : SV_Target {{ {body} }}"
    passed(compile_hlsl(tmp_path, program, "main"))


@pytest.mark.parametrize(
    "number,kind,textures", [(0, "float3", "Atlas Gains"), (1, "float4", "Neutral D0 D1 D2 D3 Sum")]
)
def test_custom_nodes_for_unreal_compile(tmp_path, number, kind, textures):
    code = recipe("Unreal", number)
    inputs = [f"{UNREAL_TYPES[name]} {name}" for name in UNREAL_TYPES if re.search(rf"\b{name}\b", code)]
    # The engine hands a node its inputs as arguments, and a sampler beside each texture; this macro is its own.
    inputs += [f"Texture2D {name}, SamplerState {name}Sampler" for name in textures.split()]
    given = [line.split()[1] for line in inputs[: -len(textures.split())]]
    held = "".join(f"Texture2D t{name}; SamplerState s{name};\n" for name in textures.split())
    constants = "".join(f"{UNREAL_TYPES[name]} g{name};\n" for name in given)
    call = ", ".join([*(f"g{name}" for name in given), *(f"t{name}, s{name}" for name in textures.split())])
    program = f"""#define Texture2DSample(t, s, uv) t.Sample(s, uv)
{held}cbuffer Inputs {{ {constants} }};
{kind} Node({", ".join(inputs)}) {{
{code}}}
float4 main() : SV_Target {{ return Node({call}).xyzx; }}
"""
    passed(compile_hlsl(tmp_path, program, "main"))

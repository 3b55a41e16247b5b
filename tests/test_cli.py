"""The command line through its real entry: what it prints, its exit codes, and what it leaves."""

from __future__ import annotations

import errno
import io
import json
import re
import signal
import subprocess
import sys
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import Literal, get_args, get_origin, get_type_hints

import numpy as np
import pytest
from frames import made_up_frame

import ssr_ref
from ssr_ref.__main__ import main, split_global_options
from ssr_ref.camera import Camera, View
from ssr_ref.cli import progress as progress_module
from ssr_ref.cli.options import SETTING_OPTIONS
from ssr_ref.cli.output import Output
from ssr_ref.fileio import bundle as bundle_module
from ssr_ref.fileio.bundle import load_bundle, write_bundle
from ssr_ref.settings import Settings

TESTS = Path(__file__).parent
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def made_up_render(scene, camera=None, settings=None, *, more=None, progress=None):
    """Stands for the pipeline: the camera and settings that it would use, made-up buffers."""
    from ssr_ref.pipeline import Traced
    from ssr_ref.scenes import framed_view

    settings = (settings or Settings()).resolved(scene.radius())
    camera = camera or scene.view or framed_view(scene)
    if isinstance(camera, View):
        camera = camera.camera(settings.size, 2.0**-10 * scene.radius())
    if progress is not None:
        progress("trace", 0.5)
    frame = made_up_frame((1, 1) if settings.size == (960, 540) else settings.size)
    size = frame.settings.size
    return replace(
        frame,
        scene=scene,
        camera=camera,
        settings=replace(settings, size=size),
        more={
            name: Traced(replace(other.resolved(1.0), size=size), frame.hits, frame.resolved)
            for name, other in (more or {}).items()
        },
    )


@pytest.fixture
def rendered(monkeypatch):
    """Settings and cameras of the renders that were asked for."""
    asked = []

    def render(scene, camera=None, settings=None, *, more=None, progress=None):
        asked.append((scene, camera, settings, *(more or {}).items()))
        return made_up_render(scene, camera, settings, more=more, progress=progress)

    monkeypatch.setattr("ssr_ref.pipeline.render", render, raising=False)
    return asked


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working folder with a mesh in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "triangle.obj").write_text(TRIANGLE)
    return tmp_path


@pytest.fixture(scope="module")
def golden(tmp_path_factory):
    return write_bundle(made_up_frame(), tmp_path_factory.mktemp("golden") / "golden")


def run_line(arguments: str) -> int:
    return main(arguments.split())


def without_colors(text: str) -> str:
    """Typer colours its help where a variable of the environment asks for it."""
    return re.sub(r"\x1b\[[0-9;]*m", "", text)


def assert_one_line(capsys, told: str = "") -> str:
    """Nothing on stdout, one `error:` line on stderr."""
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ") and err.endswith("\n") and err.count("\n") == 1, err
    assert told in err
    return err


# Help, version, start-up


@pytest.mark.parametrize("line", ["--help", "render --help", "info -h", "scenes --help", ""])
def test_help(capsys, line):
    assert run_line(line) == 0
    out, err = capsys.readouterr()
    assert "Usage: ssr-ref" in without_colors(out) and err == ""


@pytest.mark.parametrize("line", ["--version", "render --version", "--quiet --version"])
def test_version(capsys, line):
    assert run_line(line) == 0
    assert capsys.readouterr() == (f"ssr-ref {ssr_ref.__version__}\n", "")


def test_every_setting_has_an_option_of_its_type():
    names = [name for _, name, _, _ in SETTING_OPTIONS]
    shown = {*names, "size", "fallback", "fallback_color"}  # these three are spelt out
    assert shown == set(Settings.__dataclass_fields__) and len(names) == len(set(names))
    hints = get_type_hints(Settings)
    for _, name, metavar, _ in SETTING_OPTIONS:
        parts = [part for part in get_args(hints[name]) if part is not type(None)]
        parts = [] if get_origin(hints[name]) is tuple else parts
        if get_origin(hints[name]) is Literal:
            assert metavar == "|".join(parts), name
        else:
            kind = parts[0] if parts else hints[name]
            pair = tuple[float, float]
            assert metavar == {int: "N", float: "X", bool: None, pair: "A,B"}[kind], name


def subprocess_of(code: str, *arguments: str, **options):
    paths = [str(TESTS), str(TESTS.parent)]
    script = f"import sys; sys.path[:0] = {paths}\n" + textwrap.dedent(code)
    return subprocess.run(
        [sys.executable, "-c", script, *arguments],
        capture_output=True, text=True, timeout=120, **options,
    )  # fmt: skip


def test_help_imports_neither_numba_nor_numpy():
    done = subprocess_of("""
        from ssr_ref.__main__ import main
        assert main(["render", "--help"]) == 0
        heavy = {"numba", "numpy", "OpenEXR", "PIL", "trimesh"} & set(sys.modules)
        sys.exit(str(heavy) if heavy else 0)
    """)
    assert done.returncode == 0, done.stderr


def test_threads_take_effect_before_numba_starts():
    done = subprocess_of("""
        from ssr_ref.__main__ import main
        assert main(["scenes", "--threads", "1"]) == 0
        import numba
        print(numba.config.NUMBA_NUM_THREADS)
    """)
    assert done.stdout.splitlines()[-1] == "1", done.stderr


def test_module_entry():
    done = subprocess.run(
        [sys.executable, "-m", "ssr_ref", "info", "no such folder"],
        capture_output=True, text=True, cwd=TESTS.parent,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(r"error: .*no such folder.*\n", done.stderr)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("render a --quiet", (["--quiet"], ["render", "a"], None)),
        ("render a -v --verbose", (["-v", "--verbose"], ["render", "a"], None)),
        ("--json info b", (["--json"], ["info", "b"], None)),
        ("render a -q --threads 3 -o x", (["-q"], ["render", "a", "-o", "x"], "3")),
        ("--threads=2 scenes", ([], ["scenes"], "2")),
        ("render --threads", ([], ["render"], "nothing")),
        ("render -- --quiet", ([], ["render", "--", "--quiet"], None)),
    ],
)
def test_global_options_may_stand_anywhere(line, expected):
    assert split_global_options(line.split()) == expected


# render


def test_render_writes_a_bundle_and_reports(folder, rendered, capsys):
    assert run_line("render triangle.obj -o out --size 37x23") == 0
    out, err = capsys.readouterr()
    bundle = load_bundle(folder / "out")
    for word in ("out", "37x23", "rays", "hits", "thickness", "max_distance", "near", "seconds"):
        assert word in out
    assert bundle.manifest["content_sha256"] in out
    assert err == "warning: made-up buffers\n"
    assert sorted(p.name for p in folder.iterdir()) == ["out", "triangle.obj"]
    run = json.loads((folder / "out" / "run.json").read_bytes())
    assert {"load", "trace", "write"} <= set(run["seconds"])


def test_quiet_prints_only_warnings(folder, rendered, capsys):
    assert run_line("render triangle.obj -o out --quiet --no-previews") == 0
    assert capsys.readouterr() == ("", "warning: made-up buffers\n")


@pytest.mark.parametrize(
    "line", ["--json render triangle.obj -o o", "render triangle.obj --json -o o"]
)
def test_json_prints_one_object(folder, rendered, capsys, line):
    assert run_line(line) == 0
    told = json.loads(capsys.readouterr().out)
    manifest = load_bundle(folder / "o").manifest
    assert told["content_sha256"] == manifest["content_sha256"]
    assert told["settings"] == manifest["settings"] and told["far"] == "inf"
    assert told["hits"] == manifest["statistics"]["hits"] and told["output"] == "o"


def test_no_previews(folder, rendered):
    assert run_line("render triangle.obj -o out --no-previews") == 0
    assert not (folder / "out" / "previews").exists()


def test_default_size(folder, rendered):
    assert run_line("render triangle.obj -o out --no-previews") == 0
    assert rendered[0][2].size == (960, 540)


def test_options_win_over_the_settings_file(folder, rendered):
    given = Settings(size=(9, 7), stride=4, jitter=True, fresnel=True, max_distance=3.0)
    (folder / "s.json").write_text(json.dumps(given.to_json()))
    line = "render triangle.obj -o out --settings s.json --stride 2 --no-jitter --max-distance inf"
    assert run_line(line + " --no-previews") == 0
    assert rendered[0][2] == replace(given, stride=2, jitter=False, max_distance=np.inf)


def test_every_setting_can_be_given(folder, rendered):
    line = (
        "render triangle.obj -o out --size 5x3 --tracer cells --stride 3 --jitter --seed 7 "
        "--max-steps 99 --max-distance 2.5 --bias 0.25 --thickness 0.5 --thickness-from constant "
        "--back-any-object --surface plane --facing-test --interval cell --refine none "
        "--self-rejection none --geo-normals fitted --no-edge-fade "
        "--edge-power 2 --distance-fade linear --fresnel --fallback-color 0.1,0.2,0.3 "
        "--max-roughness 0.75 --snap gpu_vertices --buffer-dtype float64 --no-previews "
        "--edge-shape smoothstep --edge-range 0.1,0.9 --edge-unit mean --edge-combine sum "
        "--distance-start 0.25 --steps-fade power --steps-fade-out 2 --steps-fade-in 0.15 "
        "--facing-fade linear --facing-measure axis --facing-range -0.5,0.5 "
        "--residual-fade smoothstep --residual-end 0.125 --residual-power 2 --sample-counts"
    )
    assert run_line(line) == 0
    assert rendered[0][2] == Settings(
        size=(5, 3), tracer="cells", stride=3, jitter=True, seed=7, max_steps=99,
        max_distance=2.5, bias=0.25, thickness=0.5, thickness_from="constant",
        back_any_object=True, surface="plane", facing_test=True, interval="cell",
        refine="none", self_rejection="none", geo_normals="fitted",
        edge_fade=False, edge_power=2.0, distance_fade="linear", fresnel=True,
        fallback="constant", fallback_color=(0.1, 0.2, 0.3), max_roughness=0.75,
        snap="gpu_vertices", buffer_dtype="float64",
        edge_shape="smoothstep", edge_range=(0.1, 0.9), edge_unit="mean", edge_combine="sum",
        distance_start=0.25, steps_fade="power", steps_fade_out=2.0, steps_fade_in=0.15,
        facing_fade="linear", facing_measure="axis", facing_range=(-0.5, 0.5),
        residual_fade="smoothstep", residual_end=0.125, residual_power=2.0, sample_counts=True,
    )  # fmt: skip
    line = (
        "render triangle.obj -o two --size 5x3 --tracer march --step 0.125 --growth constant "
        "--max-steps 9 --refine bisect --refine-steps 5 --listing --no-previews"
    )
    assert run_line(line) == 0
    assert rendered[1][2] == Settings(
        size=(5, 3), tracer="march", step=0.125, growth="constant", max_steps=9,
        refine="bisect", refine_steps=5, listing=True,
    )  # fmt: skip
    given = [made[2].to_json() for made in rendered]
    same = [n for n, v in Settings().to_json().items() if all(made[n] == v for made in given)]
    assert same == []  # every setting was given a value that is not its default


def test_methods_are_traced_on_one_gbuffer(folder, rendered, capsys):
    line = "render triangle.obj -o out --size 5x3 --method dda,exact,planes,march --stride 4"
    assert run_line(line) == 0
    first = Settings(size=(5, 3), stride=4)
    _, _, settings, *more = rendered[0]
    assert settings == first and more == [
        ("exact", replace(first, tracer="cells")),
        ("planes", replace(first, tracer="cells", surface="plane")),
        ("march", replace(first, tracer="march")),
    ]
    out = capsys.readouterr().out
    assert [line.split()[0] for line in out.split("fetches a ray")[1].splitlines()[1:]] == [
        "dda", "exact", "planes", "march",
    ]  # fmt: skip
    assert run_line("info out") == 0
    assert "further methods" in capsys.readouterr().out

    # Again from its own files.
    again = "render triangle.obj -o again --settings out/settings.json --more out/methods.json"
    assert run_line(again + " --no-previews") == 0
    assert load_bundle(folder / "again").more == load_bundle(folder / "out").more

    # One method alone, and the DDA with planes.
    assert run_line("render triangle.obj -o one --method dda --surface plane --no-previews") == 0
    assert rendered[2][2:] == (Settings(surface="plane"),)


def test_scene_options_reach_the_loader(folder, rendered, monkeypatch):
    asked = []

    def load(source, **options):
        asked.append((source, options))
        return made_up_frame().scene

    monkeypatch.setattr("ssr_ref.fileio.load.load", load)
    line = "render teapot -o out --mirror-floor --normals smooth --tessellation 5 --no-previews"
    run_line(line + " --up z --unit cm --strict --allow-outside --scene 2 --force")
    run_line(line + " --scene Front --force")
    plain = {"normals": "smooth", "mirror_floor": True, "tessellation": 5, "up": "y"}
    plain |= {"unit": None, "strict": False, "allow_outside": False, "scene": "Front"}
    given = {"up": "z", "unit": "cm", "strict": True, "allow_outside": True, "scene": 2}
    assert asked == [("teapot", plain | given), ("teapot", plain)]


def test_lens_options_change_the_scenes_view(folder, rendered):
    (folder / "view.json").write_text('{"eye": [1, 2, 9], "target": [0, 0, 0], "far": 50}')
    assert run_line("render triangle.obj -o a --fov 70 --near 0.5 --no-previews") == 0
    assert (
        run_line("render triangle.obj -o b --camera view.json --orthographic 3 --no-previews") == 0
    )
    assert run_line("render triangle.obj -o c --camera view.json --far 20 --no-previews") == 0
    assert run_line("render triangle.obj -o d --no-previews") == 0
    views = [camera for _, camera, _ in rendered]
    assert (views[0].fov_y_degrees, views[0].near) == (70, 0.5)
    assert views[1] == View((1, 2, 9), (0, 0, 0), far=50, orthographic_height=3)
    assert views[2] == View((1, 2, 9), (0, 0, 0), far=20)
    assert views[3] is None  # the pipeline's own choice
    assert not load_bundle("b").camera.is_perspective


def test_a_bundle_renders_again_from_its_own_files(folder, rendered):
    assert (
        run_line(
            "render triangle.obj -o a --size 9x7 --fov 50 --mirror-floor --bias 0.01 --no-previews"
        )
        == 0
    )
    again = (
        "render a/scene.glb -o b --camera a/camera.json --lights a/lights.json "
        "--settings a/settings.json --no-previews"
    )
    assert run_line(again) == 0
    first, second = load_bundle("a").manifest, load_bundle("b").manifest
    assert first["content_sha256"] == second["content_sha256"]
    assert isinstance(rendered[1][1], Camera)


def test_force_replaces(folder, rendered):
    assert run_line("render triangle.obj -o out --size 9x7 --no-previews") == 0
    assert run_line("render triangle.obj -o out --size 7x9 --no-previews --force") == 0
    assert load_bundle("out").manifest["size"] == [7, 9]


def test_a_taken_output_is_refused_before_any_work(folder, rendered, capsys):
    (folder / "out").mkdir()
    assert run_line("render triangle.obj -o out") == 2
    assert_one_line(capsys, "out exists")
    assert run_line("render triangle.obj -o triangle.obj/out") == 2
    assert_one_line(capsys, "is a file")
    assert rendered == []


BAD = {
    "render": "Missing argument",
    "render triangle.obj": "Missing option",
    "render triangle.obj -o out --bogus": "No such option",
    "render triangle.obj extra -o out": "unexpected extra argument",
    "rendr triangle.obj -o out": "No such command",
    "--bogus": "No such option",
    "--quiet": "Missing command",
    "render triangle.obj -o out --threads 0": "--threads is '0'",
    "render triangle.obj -o out --threads many": "--threads is 'many'",
    "render triangle.obj -o out --threads": "--threads is 'nothing'",
    "render triangle.obj -o out --threads -1": "--threads is '-1'",
    "render triangle.obj -o out --size 0x0": "0x0",
    "render triangle.obj -o out --size 20000x10": "20000x10",
    "render triangle.obj -o out --size abc": "size is 'abc'",
    "render triangle.obj -o out --size 12": "size is '12'",
    "render triangle.obj -o out --size -3x4": "size is '-3x4'",
    "render triangle.obj -o out --size 9999999999x1": "size is",
    "render triangle.obj -o out --near 5 --far 2": "near < far",
    "render triangle.obj -o out --near 5 --far 5": "near < far",
    "render triangle.obj -o out --near 0": "near is 0",
    "render triangle.obj -o out --near -1": "near is -1",
    "render triangle.obj -o out --near nan": "near is nan",
    "render triangle.obj -o out --fov 0": "field of view 0",
    "render triangle.obj -o out --fov 180": "field of view 180",
    "render triangle.obj -o out --fov nan": "field of view nan",
    "render triangle.obj -o out --fov wide": "wide",
    "render triangle.obj -o out --fov 40 --orthographic 2": "both --fov and --orthographic",
    "render triangle.obj -o out --orthographic 0": "orthographic height 0",
    "render triangle.obj -o out --tracer magic": "tracer is 'magic'",
    "render triangle.obj -o out --method magic": "method is 'magic'",
    "render triangle.obj -o out --method dda,,exact": "method is ''",
    "render triangle.obj -o out --method dda,exact,dda": "'dda' is named twice",
    "render triangle.obj -o out --method dda --tracer march": "both --method and --tracer",
    "render triangle.obj -o out --method dda --more list.json": "both --method and --more",
    "render triangle.obj -o out --method dda,march --refine rewalk": "refine is 'rewalk'",
    "render triangle.obj -o out --more list.json": "list.json",
    "render triangle.obj -o out --stride 0": "stride is 0",
    "render triangle.obj -o out --stride 1.5": "1.5",
    "render triangle.obj -o out --seed -1": "seed is -1",
    "render triangle.obj -o out --thickness -1": "thickness is -1",
    "render triangle.obj -o out --thickness nan": "thickness is nan",
    "render triangle.obj -o out --bias inf": "bias is inf",
    "render triangle.obj -o out --edge-range 0.1": "edge_range is '0.1'",
    "render triangle.obj -o out --edge-range 0.9,0.1": "edge_range is 0.9,0.1",
    "render triangle.obj -o out --steps-fade linear": "without max_steps",
    "render triangle.obj -o out --fallback-color red": "fallback color is 'red'",
    "render triangle.obj -o out --fallback-color 1,2": "fallback color is '1,2'",
    "render triangle.obj -o out --fallback-color 1,2,-3": "fallback_color",
    "render triangle.obj -o out --normals sharp": "sharp",
    "render triangle.obj -o out --tessellation 4": "tessellation",
    "render teapot -o out --tessellation 0": "tessellation is 0",
    "render missing.obj -o out": "missing.obj",
    "render no_such_scene -o out": "no_such_scene",
    "render notes.txt -o out": "notes.txt",
    "render analytic/no_such -o out": "expected analytic/ and one of marker",
    "render analytic/marker -o out --up z": "expected none but --lights",
    "render list.json -o out": "not a closed-form scene",
    "render missing.json -o out": "missing.json",
    "render . -o out": "unknown scene",
    "render points.ply -o out": "no triangles",
    "render nan.obj -o out": "finite",
    "render empty.obj -o out": "empty.obj",
    "render triangle.obj -o out --settings missing.json": "missing.json",
    "render triangle.obj -o out --settings notes.txt": "not JSON",
    "render triangle.obj -o out --settings list.json": "list.json",
    "render triangle.obj -o out --settings unknown.json": "unknown setting 'colour'",
    "render triangle.obj -o out --settings wrong.json": "wrong.json",
    "render triangle.obj -o out --camera list.json": "list.json",
    "render triangle.obj -o out --camera unknown.json": "unknown key 'colour'",
    "render triangle.obj -o out --camera half.json": "half.json",
    "render triangle.obj -o out --camera ruin.json": "ruin.json",
    "render triangle.obj -o out --camera same.json": "eye",
    "render triangle.obj -o out --camera matrices.json --fov 30": "--fov cannot change",
    "render triangle.obj -o out --lights list.json": "list.json",
    "render triangle.obj -o out --lights unknown.json": "unknown key 'colour'",
    "render triangle.obj -o out --lights words.json": "words.json",
    "render triangle.obj -o /dev/null/out": "is a file",
    "render triangle.obj -o triangle.obj": "is a file",
    "render triangle.obj -o . --force": "not a golden bundle",
    "info": "Missing argument",
    "info missing": "does not exist",
    "info triangle.obj": "is a file",
    "info .": "no manifest.json",
    "scenes extra": "extra",
}


@pytest.mark.parametrize("line", BAD)
def test_bad_input_is_one_line_and_code_2_and_leaves_nothing(folder, rendered, capsys, line):
    point = "ply\nformat ascii 1.0\nelement vertex 1\n"
    point += "".join(f"property float {c}\n" for c in "xyz") + "end_header\n0 0 0\n"
    matrices = made_up_frame().camera.to_json()
    files = {
        "points.ply": point,
        "nan.obj": TRIANGLE.replace("0 0 0", "nan nan nan").replace("v 1 0 0", "v nan 0 0")
        .replace("v 0 1 0", "v 0 nan 0"),
        "empty.obj": "",
        "notes.txt": "not a mesh, not JSON",
        "list.json": "[1, 2]",
        "unknown.json": '{"colour": 1}',
        "wrong.json": '{"size": "large", "fallback_color": "red"}',
        "half.json": '{"eye": [1, 2]}',
        "ruin.json": json.dumps({**matrices, "world_from_view_hex": [[1]], "far": "far"}),
        "same.json": '{"eye": [1, 2, 3], "target": [1, 2, 3]}',
        "matrices.json": json.dumps(matrices),
        "words.json": '{"ambient": ["a", "b", "c"], "directional": []}',
    }  # fmt: skip
    for name, text in files.items():
        (folder / name).write_text(text)
    before = sorted(folder.rglob("*"))
    assert run_line(line) == 2
    assert_one_line(capsys, BAD[line])
    assert sorted(folder.rglob("*")) == before


def test_an_interrupt_leaves_nothing_and_is_130(folder, monkeypatch, rendered, capsys):
    def interrupted(*args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(bundle_module, "write_exr", interrupted)
    assert run_line("render triangle.obj -o deep/out") == 130
    out, err = capsys.readouterr()
    assert out == "" and err.splitlines()[-1] == "interrupted" and "Traceback" not in err
    assert [p.name for p in folder.iterdir()] == ["triangle.obj"]


def test_a_full_disk_is_one_line(folder, monkeypatch, rendered, capsys):
    def full(*args, **kwargs):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(bundle_module, "write_npz", full)
    assert run_line("render triangle.obj -o out") == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert re.fullmatch(r"warning: .*\nerror: disk full .*golden\.npz.*\n", err)
    assert [p.name for p in folder.iterdir()] == ["triangle.obj"]


def test_too_little_memory_is_one_line(folder, monkeypatch, capsys):
    def greedy(*args, **kwargs):
        raise MemoryError("Unable to allocate 4.00 TiB")

    monkeypatch.setattr("ssr_ref.pipeline.render", greedy, raising=False)
    assert run_line("render triangle.obj -o out") == 2
    assert_one_line(capsys, "not enough memory")


def test_a_bug_keeps_its_traceback(folder, monkeypatch):
    def broken(*args, **kwargs):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr("ssr_ref.pipeline.render", broken, raising=False)
    with pytest.raises(ZeroDivisionError):
        run_line("render triangle.obj -o out")
    assert [p.name for p in folder.iterdir()] == ["triangle.obj"]


def test_warnings_are_one_line_each_and_told_once(folder, monkeypatch, capsys):
    import warnings

    def render(*args, **kwargs):
        for text in ("first\n  of two lines", "second", "second"):
            warnings.warn(text, ssr_ref.SsrRefWarning, stacklevel=2)
        return replace(made_up_render(*args, **kwargs), warnings=("second", "third"))

    monkeypatch.setattr("ssr_ref.pipeline.render", render, raising=False)
    assert run_line("render triangle.obj -o out --quiet --no-previews") == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines == [f"warning: {t}" for t in ("first of two lines", "second", "third")]
    assert load_bundle("out").manifest["warnings"] == ["second", "third"]


PATCHED = """
    import os, time, frames, ssr_ref.pipeline, test_cli
    from ssr_ref.__main__ import main
    from ssr_ref.fileio import bundle
    ssr_ref.pipeline.render = test_cli.made_up_render
"""


def test_a_real_file_size_limit_is_one_line_and_leaves_nothing(folder):
    # 64 KiB: scene.glb fits, golden.npz of 37x23 pixels does not.
    code = (
        PATCHED
        + """
    import resource
    resource.setrlimit(resource.RLIMIT_FSIZE, (65536, resource.RLIM_INFINITY))
    sys.exit(main(["render", "triangle.obj", "-o", "made/out", "--size", "37x23", "--quiet"]))
    """
    )
    done = subprocess_of(code, cwd=folder)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    lines = [line for line in done.stderr.splitlines() if not line.startswith("warning: ")]
    assert len(lines) == 1 and lines[0].startswith("error: disk full"), done.stderr
    assert [p.name for p in folder.iterdir()] == ["triangle.obj"]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_signal_in_mid_write_leaves_nothing(folder, number, code):
    script = (
        PATCHED
        + f"""
    def slow(path, images):
        path.write_bytes(b"half")
        os.kill(os.getpid(), {int(number)})
        time.sleep(60)
    bundle.write_exr = slow
    sys.exit(main(["render", "triangle.obj", "-o", "made/out", "--quiet"]))
    """
    )
    done = subprocess_of(script, cwd=folder)
    assert done.returncode == code and "Traceback" not in done.stderr, done.stderr
    assert [p.name for p in folder.iterdir()] == ["triangle.obj"]


# info


def test_info_prints_a_summary(golden, capsys):
    assert main(["info", str(golden)]) == 0
    out, err = capsys.readouterr()
    manifest = load_bundle(golden).manifest
    assert err == "" and "\x1b" not in out
    assert "hashes verified" in out and manifest["content_sha256"] in out
    assert re.search(r"^size +37x23$", out, re.M) and re.search(r"^scene +box ", out, re.M)
    assert re.search(r"^settings +max_distance 32, thickness 0.125$", out, re.M)
    hits = manifest["statistics"]["status"]["HIT"]
    assert re.search(rf"^  HIT +1 +{hits} +\d+\.\d %$", out, re.M)
    depth = load_bundle(golden).arrays["depth"]
    finite = depth[np.isfinite(depth)]
    row = re.search(r"^  depth +float32 +23x37 +(\S+) +(\S+) +(\d+)$", out, re.M)
    assert float(row[1]) == pytest.approx(finite.min(), rel=1e-5)
    assert float(row[2]) == pytest.approx(finite.max(), rel=1e-5)
    assert int(row[3]) == depth.size - finite.size
    size = (golden / "golden.exr").stat().st_size
    assert re.search(rf"^  golden.exr +{size}$", out, re.M)


def test_info_json_is_the_manifest(golden, capsys):
    assert main(["info", str(golden), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {**load_bundle(golden).manifest, "verified": True}


def test_info_quiet_only_verifies(golden, capsys):
    assert main(["info", str(golden), "-q"]) == 0
    assert capsys.readouterr() == ("", "")


def test_info_of_a_damaged_bundle(golden, tmp_path, capsys):
    import shutil

    copy = Path(shutil.copytree(golden, tmp_path / "b"))
    data = bytearray((copy / "golden.exr").read_bytes())
    data[len(data) // 2] ^= 64
    (copy / "golden.exr").write_bytes(data)
    assert main(["info", str(copy)]) == 2
    assert_one_line(capsys, "golden.exr does not match its hash")
    assert main(["info", str(copy), "--json"]) == 2
    assert_one_line(capsys, "golden.exr")


class Terminal(io.StringIO):
    encoding = "utf-8"

    def isatty(self):
        return True


def test_info_on_a_terminal_draws_tables(golden, monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stdout", screen)
    monkeypatch.setenv("COLUMNS", "120")
    assert main(["info", str(golden)]) == 0
    assert "──" in screen.getvalue() and "geo_normal_vs" in screen.getvalue()


def test_info_into_a_closed_pipe_is_silent(golden):
    done = subprocess.run(
        f"{sys.executable} -m ssr_ref info {golden} | head -1",
        shell=True, capture_output=True, text=True, cwd=TESTS.parent,
    )  # fmt: skip
    assert done.stdout.startswith("bundle") and done.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_output_that_cannot_be_printed_is_one_line(golden):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "ssr_ref", "info", str(golden)],
            stdout=full, stderr=subprocess.PIPE, text=True, cwd=TESTS.parent,
        )  # fmt: skip
    assert done.returncode == 2 and re.fullmatch(r"error: .*\n", done.stderr), done.stderr


# scenes


def test_scenes(capsys):
    from ssr_ref.analytic.scenes import SCENES
    from ssr_ref.scenes import BUILTIN

    names = [*BUILTIN, *("analytic/" + name for name in SCENES)]
    assert run_line("scenes") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == names
    assert run_line("scenes --json") == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told) == sorted(names)
    assert all(told[name] == builtin.description for name, builtin in BUILTIN.items())


def test_closed_form_scenes_by_name_and_by_file(folder, capsys):
    line = "render analytic/marker -o out --size 8x8 --buffer-dtype float64 --no-previews"
    assert run_line(line) == 0
    assert "surfaces" in capsys.readouterr().out
    files = "--camera out/camera.json --settings out/settings.json --lights out/lights.json"
    assert run_line(f"render out/scene.json -o again {files} --no-previews -q") == 0
    first, again = load_bundle(folder / "out"), load_bundle(folder / "again")
    assert first.manifest["content_sha256"] == again.manifest["content_sha256"]
    assert first.scene.name == "marker"


# Progress


def test_no_bar_unless_stderr_is_a_terminal(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    assert not Output().progress()._enabled
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert Output().progress()._enabled and not Output(quiet=True).progress()._enabled


def test_the_bar_appears_after_its_patience_and_goes_again(monkeypatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress_module, "PATIENCE", 0.0)
    with Output().progress() as bar:
        bar._timer.join()
        bar("trace", 0.25)
        bar._bar.refresh()
        assert "trace" in screen.getvalue() and "25 %" in screen.getvalue()
    assert screen.getvalue().endswith("\x1b[2K")  # the line is erased

    monkeypatch.setattr(progress_module, "PATIENCE", 60.0)
    quick = Terminal()
    monkeypatch.setattr(sys, "stderr", quick)
    with Output().progress() as bar:
        bar("trace", 0.25)
    assert quick.getvalue() == ""


# The whole of it


@pytest.mark.slow  # compiles every kernel
def test_a_real_golden_repeats_and_renders_again_from_its_files(folder, capsys):
    first = "render poles -o a --size 37x23 --mirror-floor --stride 2 --jitter --tessellation 4"
    assert run_line(first) == 0
    assert run_line(first.replace("-o a", "-o b")) == 0
    again = (
        "render a/scene.glb -o c --camera a/camera.json --lights a/lights.json "
        "--settings a/settings.json --no-previews"
    )
    assert run_line(again) == 0
    a, b, c = (load_bundle(name) for name in "abc")
    assert a.manifest == b.manifest
    assert c.manifest["content_sha256"] == a.manifest["content_sha256"]
    assert c.scene.content_sha256() == a.scene.content_sha256()
    assert a.manifest["statistics"]["hits"] > 50
    assert run_line("render a/scene.glb -o d --size 37x23 --bias 0.5 --no-previews") == 0
    assert load_bundle("d").manifest["content_sha256"] != a.manifest["content_sha256"]

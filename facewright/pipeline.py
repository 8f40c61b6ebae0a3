"""The main job as a story: one scan in, a rig out, each stage cached so that a killed or changed run resumes."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from facewright import __version__
from facewright.bake import BakeOptions, bake, describe_maps
from facewright.beside import Beside
from facewright.cache import StageStore, file_digest, fingerprint
from facewright.contact import Targets
from facewright.conventions import ARKIT_SHAPES
from facewright.errors import InputError
from facewright.evaluate.rig import measure_rig
from facewright.memory import peak_memory_mb
from facewright.output import OutputFolder
from facewright.packing import pack_face, pack_landmarks, pack_scan, unpack_face, unpack_landmarks, unpack_scan
from facewright.parts import PATTERNS, AssemblyOptions, EyeLook, find_irises
from facewright.read import read_scan
from facewright.read.images import check_image
from facewright.read.named import named_files
from facewright.read.scan import check_scan_file
from facewright.register import RegisterOptions, register
from facewright.rigging import assembled, in_place, shapes_of
from facewright.scan import LandmarkOptions, clean_scan, find_landmarks, read_landmarks
from facewright.scan.landmark_files import landmark_index
from facewright.template.store import find_template, read_template
from facewright.write.credits import write_credits
from facewright.write.files import PngOnce
from facewright.write.gltf import write_gltf
from facewright.write.obj import write_obj
from facewright.write.preview import draw_close_ups, write_preview
from facewright.write.report import build_report, plain, write_json
from facewright.write.rig import write_rig
from facewright.write.textures import write_textures

STAGES = ("01-read", "02-landmarks", "03-register", "04-parts", "05-transfer", "06-bake", "07-write")
# Shares of the whole time on a typical scan: they only feed the "time left" of the progress line.
# Baking goes on while shapes are transferred.
STAGE_SHARE = {
    "01-read": 0.01,
    "02-landmarks": 0.08,
    "03-register": 0.21,
    "04-parts": 0.03,
    "05-transfer": 0.31,
    "06-bake": 0.01,
    "07-write": 0.35,
}
BAKE_ALONE_SHARE = 0.28  # more, of a bake that has nothing beside it: shapes came from the cache


@dataclass(frozen=True)
class JobOptions:
    """Options of the main job; each is an option of `facewright rig` too.

    template      name of a template or a folder that holds one
    albedo        colour image of the scan, overrides what the file names
    normal_map    tangent-space normal map of the scan (+Y)
    texture_size  side of the baked maps in pixels
    units         unit of the scan file: mm, cm, dm, m, inch; default: what the format says, else what fits a face
    up            the scan's up axis (x, y, z, -x, -y, -z); default: found
    mirror        the scan is a mirror image of the person: turn it round
    eyes          "template": closed lids are opened to the template's aperture; "as-scanned": left as they are
    iris          pattern of the irises, one of parts.PATTERNS; their colour is the scan's where it shows them
    landmarks     JSON file with landmarks placed by hand; each overrides the one that was found
    formats       what to write: glb, obj
    shapes        what rig.glb and obj/ carry; "apple": exactly the 52 ARKit shapes; "full": left and right halves in
                  place of their sums, in-betweens ("name@0.5") and pair correctives ("a+b"). rig/ always has all
    jobs          cores to use, with two or more in a second process too; the result does not depend on it
    from_stage    run this stage and all after it again, whatever is cached
    """

    template: str = "hm08"
    albedo: str | None = None
    normal_map: str | None = None
    texture_size: int = 2048
    units: str | None = None
    up: str | None = None
    mirror: bool = False
    eyes: str = "template"
    iris: str = "fibres"
    landmarks: str | None = None
    formats: tuple[str, ...] = ("glb",)
    shapes: str = "apple"
    jobs: int = 2
    from_stage: str | None = None

    def __post_init__(self):
        if self.eyes not in ("template", "as-scanned"):
            raise ValueError(f"eyes is 'template' or 'as-scanned', got {self.eyes!r}")
        if self.iris not in PATTERNS:
            raise ValueError(f"iris is one of {', '.join(PATTERNS)}, got {self.iris!r}")
        if self.shapes not in ("apple", "full"):
            raise ValueError(f"shapes is 'apple' or 'full', got {self.shapes!r}")
        if not self.formats or not set(self.formats) <= {"glb", "obj"}:
            raise ValueError(f"formats are glb and obj, got {self.formats!r}")
        if self.texture_size < 1 or self.jobs < 1:
            raise ValueError(f"texture_size and jobs are 1 or more, got {self.texture_size} and {self.jobs}")


class _Run:
    """The stages of one run: looks each up in the cache, times it, reports progress."""

    def __init__(self, store, progress, rerun_from):
        self.store, self.progress, self.rerun_from = store, progress, rerun_from
        self.key = fingerprint("facewright", __version__)
        self.seconds, self.reused = {}, {}

    def stage(self, name, work, *depends, intact=lambda info: True):
        """Arrays and info of a stage: from disk if nothing it depends on changed and it is intact, else from work()."""
        self.key = fingerprint(self.key, name, *depends)
        cached = None
        if STAGES.index(name) < self.rerun_from:
            cached = self.store.load(name, self.key)
            cached = cached if cached is not None and intact(cached.info) else None
        else:
            self.rerun_from = STAGES.index(name)
        self.tell(name, "", None if cached is not None else self._left(name))
        if cached is None:
            start = time.perf_counter()
            arrays, info = work()
            cached = self.store.save(name, self.key, arrays, info, round(time.perf_counter() - start, 3))
        self.seconds[name], self.reused[name] = cached.seconds, cached.reused
        return cached.arrays, cached.info

    def tell(self, name, message, left=None):
        """Progress: stage, its number, seconds left or None: a stage from the cache may be followed by more of them."""
        if self.progress is not None:
            self.progress(name, STAGES.index(name) + 1, len(STAGES), left, message)

    def _left(self, name):
        """Seconds to the end as a stage begins its work, by those of the stages before it, in this run or as they were
        cached; None where these say too little. A bake is not asked: it depends on what went on beside it.
        """
        asked = [stage for stage in self.seconds if stage != "06-bake"]
        done = sum(STAGE_SHARE[stage] for stage in asked)
        ahead = sum(STAGE_SHARE[stage] for stage in STAGES[STAGES.index(name) :])
        if name == "06-bake" and self.reused["05-transfer"]:
            ahead += BAKE_ALONE_SHARE
        return None if done < 0.1 else sum(self.seconds[stage] for stage in asked) / done * ahead


def _stage_number(word):
    """Index of a stage named "register", "03" or "03-register"; what lies past the last one for None."""
    if word is None:
        return len(STAGES)
    for number, stage in enumerate(STAGES):
        if word in (stage, *stage.split("-", 1)):
            return number
    names = ", ".join(stage.split("-", 1)[1] for stage in STAGES)
    raise InputError(f"--from {word}: there is no such stage; the stages are {names}")


def rig_job(path, out, options=None, progress=None):
    """Run the whole job: read the scan at path, write the rig into the folder out.

    options   JobOptions
    progress  function (stage, number, count, seconds_left or None, message), or None
    returns   the report as a dict (what report.json holds)
    raises    InputError for input that cannot be used: nothing half-written is left behind
    """
    options = options or JobOptions()
    rerun_from = _stage_number(options.from_stage)
    inputs = _input_digests(path, options)
    placed = read_landmarks(options.landmarks) if options.landmarks else {}
    folder = find_template(options.template)
    template = read_template(folder)
    output = OutputFolder(out)
    with output.held() as stages:
        store = StageStore(stages)
        store.sweep()
        run = _Run(store, progress, rerun_from)
        # Threads of BLAS would only wait for each other: its matrices are small, and the job took twice the core
        # seconds with them.
        with threadpool_limits(1, user_api="blas"), Beside(options.jobs) as beside:
            return _run_job(run, Path(path), output, options, inputs, placed, template, folder, beside)


def _run_job(run, path, output, options, inputs, placed, template, folder, beside):
    scan, clean_stats = _read(run, path, options, inputs)
    scan, landmarks, pose_info = _landmarks(run, scan, options, inputs, placed)
    face = _register(run, scan, landmarks, pose_info["placed"], template, folder, options)
    face = _parts(run, scan, face, template)
    shapes, maps = _shapes_and_maps(run, scan, face, template, options, beside)
    report = _write(run, path, scan, face, shapes, maps, (clean_stats, pose_info), output, options, beside)
    report["timings_s"] = run.seconds
    report["reused"] = run.reused
    report["peak_memory_mb"] = round(peak_memory_mb() + beside.peak_mb, 1)
    report["options"] = plain(asdict(options))
    write_json(report, output.folder / "report.json")
    return report


def _read(run, path, options, inputs):
    def work():
        run.tell("01-read", f"reading {path.name}")
        scan = read_scan(path, albedo=options.albedo, normal_map=options.normal_map, unit=options.units)
        scan, stats = clean_scan(scan)
        arrays, info = pack_scan(scan)
        return arrays, info | {"clean": stats}

    arrays, info = run.stage("01-read", work, path.stem, inputs["scan"], options.units)
    return unpack_scan(arrays, info), info["clean"]


def _landmarks(run, scan, options, inputs, placed):
    def work():
        found = find_landmarks(scan, LandmarkOptions(options.up, options.units, options.mirror, placed))
        arrays, info = pack_scan(found.scan)
        marks, names = pack_landmarks(found.landmarks)
        pose = {
            "unit_mm": found.unit_mm,
            "unit_source": found.unit_source,
            "uv_flipped": found.uv_flipped,
            "notes": list(found.warnings),
            "placed": [f"mp{landmark_index(name)}" for name in placed],
            **found.stats,
        }
        return arrays | marks, info | names | {"pose": pose}

    depends = [options.up, options.units, options.mirror, inputs["landmarks"]]
    arrays, info = run.stage("02-landmarks", work, depends)
    return unpack_scan(arrays, info), unpack_landmarks(arrays, info), info["pose"]


def _register(run, scan, landmarks, placed, template, folder, options):
    register_options = RegisterOptions(eyes=options.eyes)

    def work():
        return pack_face(register(scan, landmarks, template, register_options, placed))

    template_key = [file_digest(folder / name) for name in ("template.toml", "arrays.npz")]
    arrays, info = run.stage("03-register", work, asdict(register_options), template_key)
    return unpack_face(arrays, info, template)


def _parts(run, scan, face, template):
    def work():
        return pack_face(in_place(face, find_irises(scan, face)))

    arrays, info = run.stage("04-parts", work)
    return unpack_face(arrays, info, template)


def _shapes_and_maps(run, scan, face, template, options, beside):
    """Targets of all shapes, and the baked maps, which need none of these and are made meanwhile."""
    baking = None

    def begin_baking():
        return beside.begin(bake, scan, face, _bake_options(options), max(options.jobs - 1, 1))

    def transfer():
        nonlocal baking
        baking = begin_baking()
        targets = shapes_of(face)
        info = {"names": list(template.shape_names), "extras": list(targets.extras)}
        # Lists: a stage's JSON is written with its keys sorted, and the order of targets must survive a resumed run.
        info["in_betweens"] = [[name, list(map(list, steps.items()))] for name, steps in targets.in_betweens.items()]
        info["correctives"] = [[name, list(drivers)] for name, drivers in targets.correctives.items()]
        return {"deltas": targets.deltas, "extras": np.array(list(targets.extras.values()))}, info

    arrays, info = run.stage("05-transfer", transfer, list(ARKIT_SHAPES))
    maps, _ = run.stage("06-bake", lambda: ((baking or begin_baking()).result(), {}), asdict(_bake_options(options)))
    return _targets(arrays, info), maps


def _targets(arrays, info):
    return Targets(
        tuple(info["names"]),
        arrays["deltas"],
        dict(zip(info["extras"], arrays["extras"])),
        {name: {float(weight): target for weight, target in steps} for name, steps in info["in_betweens"]},
        {name: tuple(drivers) for name, drivers in info["correctives"]},
    )


def _bake_options(options):
    return BakeOptions(size=options.texture_size)


def _write(run, path, scan, face, shapes, maps, found, output, options, beside):
    """Write all results but report.json; returns the report without what differs from run to run."""

    def work():
        figures = beside.begin(_figures, face, shapes)
        rig = assembled(face, shapes, maps, AssemblyOptions(eyes=EyeLook(pattern=options.iris)))
        rig = replace(rig, info=rig.info | {"T_rig_to_scan": _rig_to_scan(scan).tolist(), "scan": scan.name})
        closer = beside.begin(draw_close_ups, rig)
        earlier = run.store.last_info("07-write").get("files", {})
        with output.workshop() as folder:
            report = build_report(scan, face, _carried(rig, options), *found)
            write_results(rig, maps, scan, face, folder, options, path.name, closer)
            report = plain(report | figures.result())
            return {}, {"report": report, "files": output.publish(folder, earlier)}

    def intact(info):
        return output.holds(info["files"])

    return run.stage("07-write", work, [*sorted(options.formats), options.shapes, options.iris], intact=intact)[1][
        "report"
    ]


def _figures(face, shapes):
    """What measure_rig says of a face's shapes; it needs no maps."""
    return measure_rig(assembled(face, shapes, options=AssemblyOptions(eyes=None, painted=False)))


def write_results(rig, maps, scan, face, folder, options, title, closer):
    """Every file of a result but report.json and stages/; title is that of the preview, closer its close-ups on their
    way (beside.Beside)."""
    _write_files(rig, maps, face, folder, options)
    write_preview(rig, scan, face, folder / "preview.png", title, closer.result)


def _write_files(rig, maps, face, folder, options):
    """Every file of a result but the preview."""
    png, carried = PngOnce(), _carried(rig, options)
    if "glb" in options.formats:
        write_gltf(carried, folder / "rig.glb", png=png)
    if "obj" in options.formats:
        write_obj(carried, folder / "obj", png=png)
    write_credits(rig, folder / "CREDITS.txt")
    write_rig(rig, folder / "rig", png=png)
    write_textures(maps, folder / "textures", describe_maps(face, maps), png=png)


def _carried(rig, options):
    """The Rig with the targets that rig.glb and obj/ carry."""
    return rig.full() if options.shapes == "full" else rig.plain()


def _rig_to_scan(scan):
    """(4, 4): metres of rig.glb to the scan file's own units."""
    return scan.T_ours_to_scan @ np.diag([1000.0, 1000.0, 1000.0, 1.0])


def _input_digests(path, options) -> dict[str, Any]:
    """Digests of everything the user gave; InputError for what is not there or of no known format."""
    check_scan_file(path)
    for image in filter(None, (options.albedo, options.normal_map)):
        check_image(image)
    files = {"scan": path, "albedo": options.albedo, "normal_map": options.normal_map}
    digests: dict[str, Any] = {}
    for what, file in {**files, "landmarks": options.landmarks}.items():
        if file is None:
            digests[what] = None
            continue
        try:
            digests[what] = file_digest(file)
        except OSError as error:
            raise InputError(f"{what}: cannot read {file}: {error.strerror}; check the path") from error
    # What an OBJ or glTF names (materials, images) lies beside it: its own bytes do not change when they do.
    named = [[file.name, file_digest(file)] for file in named_files(path)]
    digests["scan"] = [digests["scan"], digests["albedo"], digests["normal_map"], named]
    return digests

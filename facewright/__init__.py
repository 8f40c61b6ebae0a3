"""Facewright: one neutral 3D scan of a head in, a face rig ready to animate out.

The public API, stage by stage. Nothing is loaded before it is asked for.

    from facewright import rig_job
    report = rig_job("head.obj", "result")

    from facewright import clean_scan, find_landmarks, read_scan, read_template, register
    scan, repaired = clean_scan(read_scan("head.obj"))
    found = find_landmarks(scan)
    face = register(found.scan, found.landmarks, read_template("hm08"))
"""

from __future__ import annotations

import importlib
import types

__version__ = "0.1.0"

_MODULES = {
    # the whole job
    "facewright.pipeline": ("rig_job", "JobOptions"),
    # read: a file becomes a Scan
    "facewright.read": ("read_scan",),
    # scan: repaired, stood upright, landmarks found
    "facewright.scan": ("clean_scan", "find_landmarks", "read_landmarks", "write_landmarks", "LandmarkOptions"),
    # template: the head that is fitted
    "facewright.template.store": ("read_template", "write_template", "list_templates"),
    # register: template and Scan become a Face
    "facewright.register": ("register", "RegisterOptions"),
    # transfer: the template's shapes on the Face
    "facewright.transfer": ("deformation_transfer", "transfer_shapes", "DeformationTransfer", "TransferOptions"),
    # bake: the scan's looks in the template's layout
    "facewright.bake": ("bake", "BakeOptions"),
    # parts: eyes, teeth, tongue, skeleton; the Rig put together
    "facewright.parts": ("fit_parts", "build_rig", "PartOptions", "AssemblyOptions"),
    # write: a Rig becomes files
    "facewright.write.gltf": ("write_gltf",),
    "facewright.write.obj": ("write_obj",),
    "facewright.write.rig": ("write_rig", "read_rig"),
    "facewright.write.textures": ("write_textures",),
    "facewright.write.preview": ("write_preview",),
    # compress: expression textures small enough for a game
    "facewright.compress": ("facezip", "facezip_decode", "FacezipOptions"),
    # what passes between the stages
    "facewright.data": ("Scan", "Landmarks", "Template", "Part", "Skeleton", "Face", "Material", "Mesh", "Rig"),
    "facewright.conventions": ("ARKIT_SHAPES",),
    # how shapes are meant and played
    "facewright.expand": ("expand_weights",),
    "facewright.working_set": ("read_working_set",),
    # how Facewright says no
    "facewright.errors": ("InputError", "StageError"),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}

__all__ = ["__version__", *_HOME]


class StagePackage(types.ModuleType):
    """A package that is called like its main function: `bake` and `register` name a stage's package and its verb,
    and Python gives `facewright.bake` to whichever was imported last.
    """

    def __call__(self, *arguments, **options):
        return getattr(self, self.__name__.rpartition(".")[2])(*arguments, **options)


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module 'facewright' has no attribute {name!r}")
    home = importlib.import_module(_HOME[name])
    return home if home.__name__ == f"facewright.{name}" else getattr(home, name)


def __dir__():
    return sorted(__all__)

"""Show the known head templates, or make one from an official folder.

  facewright template list
  facewright template info hm08
  facewright template fetch ict                      # downloads ICT-FaceKit Light from its makers (MIT licence)
  facewright template fetch ict --from ICT-FaceKit   # the same from a folder that is already here
  facewright template build --from FOLDER --description my_head.toml --out my_head/

Each of the four has a --help of its own.
"""

from __future__ import annotations

import sys

HELP = "list, show, build and fetch head templates"


def add_arguments(parser):
    """Arguments of `facewright template`."""
    actions = parser.add_subparsers(dest="action", metavar="list|info|build|fetch", required=True)

    def add(name, purpose):
        return actions.add_parser(name, help=purpose, description=purpose[0].upper() + purpose[1:] + ".")

    add("list", "names and folders of the known templates")
    info = add("info", "what a template holds, and its licence")
    info.add_argument("template", metavar="NAME|FOLDER", help="a template's name, or a folder that holds one")
    build = add("build", "make a template from a folder of OBJ files and a description")
    build.add_argument("--from", dest="source", required=True, metavar="FOLDER", help="the official folder")
    build.add_argument(
        "--description", default="ict", metavar="NAME|FILE", help="description (default: ict; docs/template.md)"
    )
    build.add_argument("--out", required=True, metavar="FOLDER", help="folder that receives the template")
    fetch = add("fetch", "get a template that is not shipped; then --template NAME finds it")
    fetch.add_argument("template", metavar="NAME", help="ict")
    fetch.add_argument("--from", dest="source", metavar="FOLDER", help="a local copy of the official folder")
    fetch.add_argument("--out", metavar="FOLDER", help="folder that receives it (default: ~/.facewright/templates)")


def run(options):
    """Do what was asked; returns the exit code."""
    return {"list": _list, "info": _info, "build": _build, "fetch": _fetch}[options.action](options)


def _list(_):
    from facewright.template.store import list_templates, read_info

    for name, folder in list_templates().items():
        info = read_info(folder)["info"]
        print(f"{name:<10} {info.get('title', name)} ({info.get('licence', 'no licence stated')})  {folder}")
    if "ict" not in list_templates():
        print("ict        not here yet: 'facewright template fetch ict' gets it")
    return 0


def _info(options):
    from facewright.template.store import find_template, read_info

    description = read_info(options.template)
    for key, value in description["info"].items():
        print(f"{key:<12} {', '.join(map(str, value)) if isinstance(value, list) else value}")
    print(f"{'folder':<12} {find_template(options.template)}")
    for key, value in description.get("counts", {}).items():
        print(f"{key:<12} {value}")
    print(f"{'shapes':<12} {len(description['shapes'])}")
    print(f"{'regions':<12} {', '.join(description['regions'])}")
    print(f"{'lines':<12} {', '.join(line['name'] for line in description['lines'])}")
    for part in description["parts"]:
        count = part["vertices"][1] - part["vertices"][0]
        print(f"part         {part['name']:<16} {count:>6} vertices, attached to {part['attach']}")
    return 0


def _build(options):
    from facewright.template.fetch import build_folder, description_of

    template = build_folder(options.source, description_of(options.description), options.out)
    _tell(template, options.out, options.out)
    return 0


def _fetch(options):
    from facewright.template.fetch import fetch_template

    folder, template = fetch_template(
        options.template, source_folder=options.source, out=options.out, progress=None if options.source else _progress
    )
    _tell(template, folder, options.out or options.template)
    return 0


def _tell(template, folder, word):
    counts = f"{len(template.vertices):,} vertices, {len(template.shape_names)} shapes"
    print(f"{template.info['name']} ({counts}) is in {folder}; 'facewright rig' fits it with --template {word}")


def _progress(done, total):
    share = f" of {total / 1e6:.0f}" if total else ""
    sys.stderr.write(f"\rdownloading {done / 1e6:.0f}{share} MB")
    sys.stderr.flush()

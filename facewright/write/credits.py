"""CREDITS.txt: who made what a rig is made of, and under which licence it may be passed on."""

from __future__ import annotations

from facewright.write.files import replace_file

_MIT = """\
Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated
documentation files (the "Software"), to deal in the Software without restriction, including without limitation the
rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to permit
persons to whom the Software is furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all copies or substantial portions of the
Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE
WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR
COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR
OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
"""

_DUTIES = {
    "CC0-1.0": "Dedicated to the public domain (CC0 1.0 Universal); nothing is asked, the credit is given gladly.",
    "MIT": "Keep the copyright notice and this text with copies of the rig:\n\n" + _MIT,
}


def credits_text(rig):
    """The text of CREDITS.txt for a Rig."""
    info = rig.info
    licence = info.get("licence") or "not stated"
    title = " ".join(str(info[key]) for key in ("template", "template_version") if info.get(key))
    lines = [
        "This rig was made by Facewright from a scan and a template head. The likeness, the textures and the scan's",
        "own licence are the business of whoever owns the scan; what follows is about the template.",
        "",
        f"Template: {title or 'unnamed'} (topology {info.get('topology_id', 'unknown')})",
        f"Licence:  {licence}",
        *(["Copyright: " + str(info["copyright"])] if info.get("copyright") else []),
        *(f"Credit:   {credit}" for credit in info.get("credits", ())),
        "",
        str(info.get("licence_text") or _DUTIES.get(licence, "See the template's own licence for what it asks.")),
    ]
    return "\n".join(lines).rstrip() + "\n"


def write_credits(rig, path):
    """Write CREDITS.txt."""
    replace_file(path, credits_text(rig).encode("utf-8"))

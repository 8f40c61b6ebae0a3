"""Registration of a template to a scan."""

from facewright.register.register import RegisterOptions, register

__all__ = ["RegisterOptions", "register"]

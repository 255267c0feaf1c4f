"""Surrogates for programs that know nothing of stiffarm: ONNX, a C99 header, a Python file without imports."""

from surrogate.portable.content import LINKS, Link, Portable, Status
from surrogate.portable.onnx_file import onnx_model, write_onnx
from surrogate.portable.source import c_header, python_snippet

__all__ = [
    "LINKS",
    "Link",
    "Portable",
    "Status",
    "c_header",
    "onnx_model",
    "python_snippet",
    "write_onnx",
]

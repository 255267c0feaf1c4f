"""Surrogates for programs that know nothing of stiffarm: ONNX, a C99 header, Python and JavaScript."""

from surrogate.portable.content import LINKS, Link, Portable, Status
from surrogate.portable.javascript import evaluator_script, javascript, surrogate_data
from surrogate.portable.onnx_file import onnx_model, write_onnx
from surrogate.portable.source import c_header, python_snippet

__all__ = [
    "LINKS",
    "Link",
    "Portable",
    "Status",
    "c_header",
    "evaluator_script",
    "javascript",
    "onnx_model",
    "python_snippet",
    "surrogate_data",
    "write_onnx",
]
